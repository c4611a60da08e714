"""What each reason code means to the person who sees it, and what to do: ``python -m deploy.reasons`` prints the table.

The table stands in ``deploy/README.md``; a test keeps the two equal, and every code in it.
"""

import sys
from typing import NamedTuple

from onboard.contract.codes import Reason


class Advice(NamedTuple):
    """What is the case, and what a person does about it."""

    meaning: str
    remedy: str


_NOTHING = "nothing: it passes by itself"
#: A test looks for such codes in the sources.
_KEPT = Advice("kept in the contract: no machine of this version says it", "look at the sender's program version")

#: Where a code comes from the frame is named in docs/network.md.
ADVICE: dict[Reason, Advice] = {
    Reason.NONE: Advice("no reason is given", "nothing"),
    Reason.NO_BID: Advice(
        "nobody bid for a call: every machine of that kind is off, an obstacle, or cannot do it",
        "look at their heartbeats: who is silent or an obstacle, and why",
    ),
    Reason.PARK_FULL: _KEPT,
    Reason.CAR_TOO_LARGE: _KEPT,
    Reason.UNKNOWN_TICKET: Advice(
        "a desk read a wrong ticket: another site's, or somebody guesses",
        "nothing for a few; a customer with a right one is helped from afar (docs/operate.md)",
    ),
    Reason.TOKEN_HELD_BY_OTHER: Advice("whoever was asked for a token does not hold it", _NOTHING),
    Reason.TOKEN_NOT_GRANTABLE_YET: Advice(
        "the holder needs the token itself, or another machine passes first",
        "nothing; if it stays so, see who stands there and why that one does not move",
    ),
    Reason.TOKEN_STALE_VERSION: _KEPT,
    Reason.NOT_AUTHORISED: Advice(
        "the machine waits for a token that it has asked for; or five wrong tickets have locked a desk for a minute",
        "nothing; if it stays so, find the token's holder; at a desk, see who stands there",
    ),
    Reason.MIRROR_BEHIND: Advice(
        "two machines know different plans; they ask each other for what is missing",
        "nothing; if it comes often, frames are lost: queue length, bus load, error counters",
    ),
    Reason.OTHER_CONTRACT: Advice(
        "a machine speaks another version of the contract", "install the same program on all boards"
    ),
    Reason.OTHER_SITE: Advice(
        "a machine has another site file; it joins as an obstacle and never bids",
        "put the same site file on all boards, and start that one again",
    ),
    Reason.BUS_TIME_LOST: Advice(
        "no fixed machine tells the time: no calls are heeded until one does",
        "switch a lift, compartment or other fixed machine on; look at the cable to it",
    ),
    Reason.POSITION_UNKNOWN: Advice(
        "the machine has not sensed where it is, or has just come back, or is an obstacle",
        "wait for its sensors; if it stays so, bring it to a mark by hand and look at its device bus",
    ),
    Reason.JOURNAL_LOST: Advice(
        "a machine that was started again gives back a task that it knows nothing of any more; or its journal cannot "
        "be written",
        "nothing: the task is called again, the machine started again; if it goes on, look at the medium of its "
        "journal: is it full?",
    ),
    Reason.ACTUATOR_FAULT: Advice(
        "a drive, shuttle or door does not do what it was ordered, or the machine is stopped",
        "look at the machine, clear the fault, then start its controller again",
    ),
    Reason.SENSOR_FAULT: Advice(
        "a machine's sensors deny what its journal or its work say: load or shuttle are not where they must be; it "
        "stands",
        "its own log says which; put it right by hand, and it goes on by itself",
    ),
    Reason.INVARIANT_BROKEN: Advice(
        "a belief of the controller was wrong; it was stopped and is started again",
        "keep its recording and what its console says, and report them; the third time in a row it waits for a person",
    ),
    Reason.INCOMPLETE_SET: Advice(
        "frames of one message did not all arrive",
        "nothing for a few; for many: queue length 1000 at every interface, error counters, bus load",
    ),
    Reason.UNKNOWN_IDENTIFIER: Advice(
        "somebody sends frames of no contract", "find the sender by the identifier's lowest byte, and take it off"
    ),
    Reason.SHORT_FRAME: Advice("a frame is shorter than the contract says", "find the sender, as above"),
    Reason.VALUE_OUT_OF_RANGE: Advice("a value is not one of the contract", "find the sender, as above"),
    Reason.DUPLICATE_NODE_ID: Advice(
        "two boards have one node-ID; the machine stops and is silent",
        "give each board its own machine file, then start both again",
    ),
    Reason.LATE: Advice(
        "a word came after its time", "nothing for a few; for many: bus load, and the processor of the sender"
    ),
    Reason.QUEUE_FULL: Advice(
        "frames came faster than the controller could take them", "find who floods the bus; is the processor too slow?"
    ),
    Reason.CANCELLED: Advice("whoever asked has taken it back", "nothing"),
    Reason.OPERATOR: Advice(
        "the machine is stopped, by a fault or by hand", "clear what stopped it, then start its controller again"
    ),
    Reason.DOOR_NOT_READY: Advice(
        "a door, platform or compartment is not yet where the way leads through it",
        "nothing; if it stays so, look for what is in the door",
    ),
    Reason.BEATEN: Advice("another machine's bid was better", "nothing"),
    Reason.IMPOSSIBLE: Advice(
        "the machine cannot do what was asked, from where it is and with what is in its way",
        "look for machines and blocked segments in its way",
    ),
    Reason.PERSON_INSIDE: _KEPT,
    Reason.NODE_SILENT: Advice(
        "a machine has not been heard for three heartbeats, and counts as an obstacle",
        "its power, its cable, and what its console says",
    ),
    Reason.NOT_OF_SITE: Advice(
        "a node that the site file does not have speaks",
        "find the sender by the identifier's lowest byte, and take it off",
    ),
    Reason.NOT_OF_KIND: Advice(
        "a machine says what its kind may not say",
        "is that board's machine file right? Else find the sender, and take it off",
    ),
    Reason.NOT_THE_HOLDER: Advice(
        "a token was granted by a node that the receiver does not believe to hold it; both name what they know",
        "nothing for a few; if it stays so, look at the journals of both, and at who speaks under their numbers",
    ),
    Reason.RIGHT_CLAIMED: Advice(
        "a machine claims a right that another one holds, which keeps it",
        "look at the machine that claims: an old journal, or somebody who speaks under its number",
    ),
    Reason.EMERGENCY_STOP: Advice(
        "somebody has said an emergency stop", "find out why; then `onboard operate go`, or start the controller again"
    ),
    Reason.LEFT_OUT: Advice(
        "a machine that forfeited a task is left out of its next calls", "why did it not do it? See what it said before"
    ),
    Reason.OTHER_EPOCH: Advice(
        "a machine was absent when rights were regenerated; it joins as an obstacle",
        "clear its journal only where it was declared absent: see replacing, above",
    ),
    Reason.JOURNAL_SHORT: Advice(
        "a journal lacks what others know of it: an old copy, or its end is lost; the machine lives and holds",
        "`onboard operate regenerate`: see replacing, above",
    ),
    Reason.JOURNAL_FOREIGN: Advice(
        "the journal is that of another machine or site; the machine lives and holds, and writes nothing",
        "put the right board or its own journal in; else move that file away and see replacing, above",
    ),
    Reason.NO_FRESH_PROOF: Advice(
        "what a movement depends on was not confirmed just now: a sill, a bay, a platform", _NOTHING
    ),
    Reason.RUNAWAY: Advice(
        "a machine's steps did not come to rest; it was stopped and is started again",
        "keep its recording and what its console says, and report them; the third time in a row it waits for a person",
    ),
    Reason.WATCHDOG: Advice(
        "a controller hung, its supervisor ended it, and it was started again",
        "once: nothing; if it comes again: the board's processor, its power and its card",
    ),
    Reason.BUS_LOST: Advice(
        "a board's CAN interface was gone, and has come back; the machine stood meanwhile",
        "for more than one: the adapter's plug and cable, `dmesg` on the board",
    ),
    Reason.CLOCK_JUMPED: Advice(
        "a machine's clock does not fit the bus time", "nothing for one; if it comes again, change that board"
    ),
    Reason.FALSE_STATEMENT: Advice(
        "a machine said what its own sensors, or those of others, refute", "look at that machine and its sensors"
    ),
    Reason.REGENERATION: Advice(
        "rights are being regenerated; machines stand meanwhile",
        "finish it, or end it with `onboard operate regenerate`",
    ),
}


def table() -> list[str]:
    """The table in Markdown, one line each, in the order of the codes."""
    rows = [f"| {code.value} | `{code.name}` | {ADVICE[code].meaning} | {ADVICE[code].remedy} |" for code in Reason]
    return ["| code | name | what is the case | what to do |", "|---|---|---|---|", *rows]


if __name__ == "__main__":
    sys.stdout.write("\n".join([*table(), ""]))

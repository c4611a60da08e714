"""What each reason code means to the person who sees it, and what to do: ``python -m deploy.reasons`` prints the table.

The table stands in ``deploy/README.md``; a test keeps the two equal, and every code in it.
"""

import sys
from typing import NamedTuple

from onboard.core.codes import Reason


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
    Reason.UNKNOWN_TICKET: _KEPT,
    Reason.TOKEN_HELD_BY_OTHER: Advice("whoever was asked for a token does not hold it", _NOTHING),
    Reason.TOKEN_NOT_GRANTABLE_YET: Advice(
        "the holder needs the token itself, or another machine passes first",
        "nothing; if it stays so, see who stands there and why that one does not move",
    ),
    Reason.TOKEN_STALE_VERSION: _KEPT,
    Reason.NOT_AUTHORISED: Advice(
        "the machine waits for a token that it has asked for", "nothing; if it stays so, find the token's holder"
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
        "a machine that was started again gives back a task that it knows nothing of any more",
        "nothing: it is called again; if it comes without a restart, look at the medium of its journal",
    ),
    Reason.ACTUATOR_FAULT: Advice(
        "a drive, shuttle or door does not do what it was ordered, or the machine is stopped",
        "look at the machine, clear the fault, then start its controller again",
    ),
    Reason.SENSOR_FAULT: _KEPT,
    Reason.INVARIANT_BROKEN: _KEPT,
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
}


def table() -> list[str]:
    """The table in Markdown, one line each, in the order of the codes."""
    rows = [f"| {code.value} | `{code.name}` | {ADVICE[code].meaning} | {ADVICE[code].remedy} |" for code in Reason]
    return ["| code | name | what is the case | what to do |", "|---|---|---|---|", *rows]


if __name__ == "__main__":
    sys.stdout.write("\n".join([*table(), ""]))

"""States and reasons in words for a person, with what to do where something is to be done."""

from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import Halted
from onboard.holon.remedies import reason_words, remedy
from onboard.operate.park import Park

_STATES = {
    MachineState.STARTING: "starts",
    MachineState.IDLE: "is idle",
    MachineState.WORKING: "works",
    MachineState.WAITING: "waits",
    MachineState.OBSTACLE: "stands, others plan around it",
    MachineState.STOPPED: "stands, it has stopped itself",
}


def halted_words(park: Park, word: Halted) -> str:
    """Why a machine stands, who brought it about, and what to do where a person is needed."""
    text = f"stands: {reason_words(word.reason)}"
    if word.cause:
        text += f" by {park.name(word.cause)}"
    if word.sender != word.machine:
        why = "itself it says that it goes" if word.reason is Reason.FALSE_STATEMENT else "itself it is silent"
        text += f" (said by {park.name(word.sender)}; {why})"
    what = remedy(park.site, word.reason, park.name(word.machine))
    return text + (f"; needs a person: {what}" if word.needs_person else "; goes on by itself")


def state_words(park: Park, node: int, now_us: int) -> str:
    """One machine in one phrase."""
    known = park.machines[node]
    word = park.halted(node, now_us)
    if word is not None and word.reason is not Reason.NODE_SILENT:
        return halted_words(park, word)
    if not park.lives(node, now_us):
        return "is not heard: off, or not on this bus"
    if known.foreign is not Reason.NONE:
        what = "contract" if known.foreign is Reason.OTHER_CONTRACT else "site file"
        return f"is a stranger: it has another {what}"
    if known.is_held:
        return "is held by a person" + (" and stands" if known.is_at_rest else ", and comes to rest")
    return _STATES[known.beat.state] if known.beat is not None else "is heard, its heartbeat not yet"

"""States and reasons in words for a person, with what to do where something is to be done."""

from onboard.core.codes import MachineState, Reason
from onboard.core.journal_state import RIGHTS_LOST
from onboard.core.recovery_messages import Halted
from onboard.core.site import Site
from onboard.kinds.car_park.site import CarPark
from onboard.operate.park import Park

#: What a person does about a machine that stands for this reason (docs/operate.md).
REMEDIES = {
    Reason.EMERGENCY_STOP: "onboard operate go",
    Reason.JOURNAL_LOST: "onboard operate regenerate {name}",
    Reason.JOURNAL_SHORT: "onboard operate regenerate {name}",
    Reason.JOURNAL_FOREIGN: "put the right board or its own journal in; where that is lost, move the file away, "
    "start it and onboard operate regenerate {name}",
    Reason.DUPLICATE_NODE_ID: "find who else speaks under its node-ID, then onboard operate release {name}",
    Reason.OPERATOR: "onboard operate release {name}",
    Reason.REGENERATION: "onboard operate regenerate is under way, or was broken off: start it again",
}

_STATES = {
    MachineState.STARTING: "starts",
    MachineState.IDLE: "is idle",
    MachineState.WORKING: "works",
    MachineState.WAITING: "waits",
    MachineState.OBSTACLE: "stands, others plan around it",
    MachineState.STOPPED: "stands, it has stopped itself",
}


def reason_words(reason: Reason) -> str:
    """``emergency stop`` for ``EMERGENCY_STOP``."""
    return reason.name.lower().replace("_", " ")


#: Where rights cannot be made anew one by one: all machines begin as on the first day.
START_ANEW = (
    "bring all machines to where the site file has them, put all their journals away together, start them, and give "
    "open orders again"
)


def remedy(site: Site, reason: Reason, name: str) -> str:
    """What a person does about machine ``name`` that stands for this reason."""
    if reason in RIGHTS_LOST and not has_regeneration(site):
        return f"its own journal, as it was last, in; else {START_ANEW}"
    return REMEDIES.get(reason, "go and see").format(name=name)


def has_regeneration(site: Site) -> bool:
    """Whether rights can be made anew: only of a car park is it known whose each right is, and what stands where."""
    return isinstance(site, CarPark)


def halted_words(park: Park, word: Halted) -> str:
    """Why a machine stands, who brought it about, and what to do where a person is needed."""
    said = f"stands: {reason_words(word.reason)}"
    if word.cause:
        said += f" by {park.name(word.cause)}"
    if word.sender != word.machine:
        said += f" (said by {park.name(word.sender)}; itself it is silent)"
    then = remedy(park.site, word.reason, park.name(word.machine))
    return said + (f"; needs a person: {then}" if word.needs_person else "; goes on by itself")


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

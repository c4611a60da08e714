"""What a person does about a machine that stands, by the reason that it gives (docs/operate.md)."""

from onboard.contract.codes import Reason
from onboard.core.journal_state import RIGHTS_LOST
from onboard.core.site import Site

#: ``{name}`` is the machine's.
REMEDIES = {
    Reason.EMERGENCY_STOP: "onboard operate go",
    Reason.JOURNAL_LOST: "onboard operate regenerate {name}",
    Reason.JOURNAL_SHORT: "onboard operate regenerate {name}",
    Reason.JOURNAL_FOREIGN: "put the right board or its own journal in; where that is lost, move the file away, "
    "start it and onboard operate regenerate {name}",
    Reason.DUPLICATE_NODE_ID: "find who else speaks under its node-ID, then onboard operate release {name}",
    Reason.OPERATOR: "onboard operate release {name}",
    Reason.REGENERATION: "onboard operate regenerate is under way, or was broken off: start it again",
    Reason.ACTUATOR_FAULT: (
        "look at its drives and what they move, and at its battery, clear the fault, then start its controller again"
    ),
    Reason.SENSOR_FAULT: (
        "its sensors deny what it knows of what it carries and moves: its own log says what; put that right, and it "
        "goes on by itself; else start its controller again"
    ),
    Reason.FALSE_STATEMENT: "it says that it goes and stands with what it has in hand: see what keeps it, or tow it",
}
#: For all other reasons.
GO_AND_SEE = "go and see"


#: Where rights cannot be made anew one by one: all machines begin as on the first day.
START_ANEW = (
    "bring all machines to where the site file has them, put all their journals away together, start them, and give "
    "open orders again"
)


def remedy(site: Site, reason: Reason, name: str) -> str:
    """What to do about the machine of this name."""
    if reason in RIGHTS_LOST and not site.has_regeneration:
        return f"its own journal, as it was last, in; else {START_ANEW}"
    return REMEDIES.get(reason, GO_AND_SEE).format(name=name)


def reason_words(reason: Reason) -> str:
    """A reason code in lower case with spaces, for lines that people read: ``emergency stop``."""
    return reason.name.lower().replace("_", " ")

"""What a person does about a machine that stands, by the reason that it gives (docs/operate.md)."""

from onboard.core.codes import Reason

#: ``{name}`` is the machine's.
REMEDIES = {
    Reason.EMERGENCY_STOP: "onboard operate go",
    Reason.JOURNAL_LOST: "onboard operate regenerate {name}",
    Reason.JOURNAL_SHORT: "onboard operate regenerate {name}",
    Reason.JOURNAL_FOREIGN: "put its own journal back, or onboard operate regenerate {name}",
    Reason.DUPLICATE_NODE_ID: "find who else speaks under its node-ID, then onboard operate release {name}",
    Reason.OPERATOR: "onboard operate release {name}",
    Reason.REGENERATION: "onboard operate regenerate is under way, or was broken off: start it again",
    Reason.FALSE_STATEMENT: "it says that it goes and stands with what it has in hand: see what keeps it, or tow it",
}
#: For all other reasons.
GO_AND_SEE = "go and see"


def remedy(reason: Reason, name: str) -> str:
    """What to do about the machine of this name."""
    return REMEDIES.get(reason, GO_AND_SEE).format(name=name)


def reason_words(reason: Reason) -> str:
    """``emergency stop`` for ``EMERGENCY_STOP``."""
    return reason.name.lower().replace("_", " ")

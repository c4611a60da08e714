"""What becomes of a process whose controller has halted: a supervisor brings it back at once, or a person does."""

from collections.abc import Callable

from onboard.contract.codes import Reason

#: The belief was wrong, not the world: it is built anew from journal and sensors. Not for ever: ``LifeBook``.
OWN_FAULTS = frozenset({Reason.INVARIANT_BROKEN, Reason.RUNAWAY})
#: After these starting again may heal it; every other reason waits for a person.
COMES_BACK = OWN_FAULTS | {Reason.WATCHDOG, Reason.BUS_LOST}

#: Whether nobody but a person brings a controller back that halts now for a reason; None: its journal.
NeedsPerson = Callable[[Reason | None], bool]


def needs_person(reason: Reason | None) -> bool:
    """The same where nothing is known of lives before: a medium that cannot be written may have room again."""
    return reason is not None and reason not in COMES_BACK

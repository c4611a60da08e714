"""How a controller's process ends, and who brings it back: a supervisor at once, or a person."""

from enum import IntEnum

from onboard.contract.codes import Reason


class ExitStatus(IntEnum):
    """Exit statuses of ``onboard``; ``deploy/files/onboard.service`` starts it again but after the last two."""

    STOPPED = 0
    #: Starting again may heal it: recovery takes place and rights from the journal and the sensors.
    COMES_BACK = 1
    #: A command line, a machine file or a site file that must be mended.
    MISTAKE = 2
    #: Only a person can know what is so.
    WAITS_FOR_PERSON = 3


#: The belief was wrong, not the world: it is built anew from journal and sensors. Not for ever, see ``lives.LIMIT``.
OWN_FAULTS = frozenset({Reason.INVARIANT_BROKEN, Reason.RUNAWAY})
#: What a halt means for the process; every other reason waits for a person.
_COMES_BACK = OWN_FAULTS | {Reason.WATCHDOG, Reason.BUS_LOST}


def ending_of(reason: Reason) -> ExitStatus:
    """What becomes of a controller that has halted for this reason."""
    return ExitStatus.COMES_BACK if reason in _COMES_BACK else ExitStatus.WAITS_FOR_PERSON

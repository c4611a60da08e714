"""How a controller's process ends, and who brings it back: a supervisor at once, or a person."""

from enum import IntEnum

from onboard.contract.codes import Reason
from onboard.ports.ending import needs_person


class ExitStatus(IntEnum):
    """Exit statuses of ``onboard``; ``deploy/files/onboard.service`` starts it again but after the last two."""

    STOPPED = 0
    #: Starting again may heal it: recovery takes place and rights from the journal and the sensors.
    COMES_BACK = 1
    #: A command line, a machine file or a site file that must be mended.
    MISTAKE = 2
    #: Only a person can know what is so.
    WAITS_FOR_PERSON = 3


def ending_of(reason: Reason | None) -> ExitStatus:
    """What becomes of a controller that has halted for this reason; None: its journal could not be written."""
    return ExitStatus.WAITS_FOR_PERSON if needs_person(reason) else ExitStatus.COMES_BACK

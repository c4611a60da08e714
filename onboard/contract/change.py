"""The word of a change of site.

Written by ``make docs`` from ``dbc/change.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, message


class ChangePhase(IntEnum):
    """How far a change of site is.

    An operator announces it and says that it is over, a machine that it has heard so.
    """

    ANNOUNCED = 0
    HEARD = 1
    OVER = 2


@message(frozen=True, slots=True)
class SiteNext(Message):
    """The present site and the announced one.

    Machines of either are machines of one site until it is over, or the operator was not heard for 10 s.
    """

    #: Of an operator, digest of the site file that is to go; of a machine, of its own, as in its heartbeat. 1 to 65535.
    site_digest: int
    #: Of an operator, digest of the site file that is to come; of a machine, the other one that counts for it. 1 to
    #: 65535.
    next_digest: int
    #: How far the change is.
    change_phase: ChangePhase

"""What machines with a battery tell of it on the fleet bus.

Written by ``make docs`` from ``dbc/battery.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, message


@message(frozen=True, slots=True)
class BatteryLevel(Message):
    """How full the sender's battery is.

    Said when the charge is another by a hundredth, when charging or bids change, and every minute.
    """

    #: What is left of its capacity; 0: it is empty, and the machine stands. 0 to 1000.
    charge_permille: int
    #: 1: it stands at a charger that gives power.
    charging: bool
    #: 1: the charge allows it to bid; 0: it charges first.
    bids: bool

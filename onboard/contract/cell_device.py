"""What the machines of the system cell say beyond the messages of all, on their device buses.

Written by ``make docs`` from ``dbc/cell.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, Reference, message
from onboard.contract.cell import ArmMode, GripAction, GripMode, RefusedFor
from onboard.contract.codes import OrderResult


@message(frozen=True, slots=True)
class ArmOrder(Message):
    """Go straight to a point.

    Repeated every drive_refresh of the site while the robot moves; a moving drive that hears none for
    DriveTimeOutMs stops by itself.
    """

    #: Grows by one with every new point; a repeat has the same. 0 to 255.
    sequence: int
    #: x of the point to go to. -524288 to 524287 mm.
    x_mm: int
    #: y of the point to go to. -524288 to 524287 mm.
    y_mm: int


@message(frozen=True, slots=True)
class GripOrder(Message):
    """Take up the part that lies here, or put it down.

    A new sequence starts it, a repeated one does nothing.
    """

    #: Grows by one with every new action. 0 to 255.
    sequence: int
    #: What to do.
    grip_action: GripAction
    #: ``origin``: Node-ID of the goal manager that named the part. 0 to 255.
    #: ``number``: Serial number of the part at its origin. 0 to 65535.
    part: Reference


@message(frozen=True, slots=True)
class OrderAnswer(Message):
    """What becomes of an order: sent on change and every 2 s until it is over."""

    #: Serial number of the order. 0 to 65535.
    order: int
    #: What became of it.
    order_result: OrderResult
    #: Cost of the accepted offer in thousandths, 0 before. 0 to 4294967295 mm.
    cost_mm: int
    #: Why it was refused.
    refused_for: RefusedFor


@message(frozen=True, slots=True)
class ArmState(Message):
    """Where the robot is: sent when its mode changes, every 500 ms while it moves, and every 10 s at rest."""

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: x of where it is. -262144 to 262143 mm.
    x_mm: int
    #: y of where it is. -262144 to 262143 mm.
    y_mm: int
    #: What the drive does.
    arm_mode: ArmMode


@message(frozen=True, slots=True)
class GripState(Message):
    """The gripper: sent when its mode changes and every 10 s."""

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: What it does.
    grip_mode: GripMode
    #: ``origin``: Node-ID that named the part in it, 0 for none. 0 to 255.
    #: ``number``: Serial number of the part in it, 0 for none. 0 to 65535.
    part: Reference


@message(frozen=True, slots=True)
class OrderFrom(Message):
    """A person or a planning module wants a part carried: where it lies.

    Sent with OrderTo, again until OrderAnswer names it.
    """

    #: Serial number of the order, which is that of the part too. 0 to 65535.
    order: int
    #: x of where the part lies. -262144 to 262143 mm.
    x_mm: int
    #: y of where the part lies. -262144 to 262143 mm.
    y_mm: int


@message(frozen=True, slots=True)
class OrderTo(Message):
    """Where the part is wanted, and in what time."""

    #: Serial number of the order. 0 to 65535.
    order: int
    #: x of where the part is wanted. -262144 to 262143 mm.
    x_mm: int
    #: y of where the part is wanted. -262144 to 262143 mm.
    y_mm: int
    #: Time for it, 0 for no limit. 0 to 2550000 ms.
    within_ms: int

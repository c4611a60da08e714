"""What the machines of the system mapd say beyond the messages of all, on their device buses.

Written by ``make docs`` from ``dbc/mapd.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, message
from onboard.contract.codes import OrderResult
from onboard.contract.mapd import CartAction


@message(frozen=True, slots=True)
class CartOrder(Message):
    """An order to a robot's body.

    Repeated every 500 ms until CartState has its sequence. A move to a neighbouring cell, once begun, is finished
    by the body itself.
    """

    #: Grows by one with every new order; a repeat has the same. 0 to 255.
    sequence: int
    #: What to do.
    cart_action: CartAction
    #: Cell to move to, or in which it is done. 0 to 63999.
    cell: int
    #: Task to load or unload, 65535 with MOVE. 0 to 65535.
    task: int
    #: Step at which it will be done: for the record. 0 to 4194303.
    step: int


@message(frozen=True, slots=True)
class TransportAnswer(Message):
    """What becomes of an order: sent on change, and for every repeated order."""

    #: Serial number of the order. 0 to 65534.
    task: int
    #: What became of it.
    transport_result: OrderResult


@message(frozen=True, slots=True)
class CartState(Message):
    """Where the body is: sent on change and every 2 s."""

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: Cell in which it is, or to which it is on its way. 0 to 63999.
    cell: int
    #: Whether it is on its way; the cell behind is free for others from the beginning.
    moving: bool
    #: The task aboard, 65535 for none. 0 to 65535.
    task: int


@message(frozen=True, slots=True)
class TransportKey(Message):
    """Somebody orders a transport.

    Said again every second until TransportAnswer names it.
    """

    #: Serial number of the order. 0 to 65534.
    task: int
    #: Cell where the goods are. 0 to 63999.
    pickup: int
    #: Cell to which they are to be brought. 0 to 63999.
    delivery: int
    #: Lowest 16 bits of the step from which on it is to be called for. 0 to 65535.
    release: int

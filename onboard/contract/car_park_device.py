"""What the machines of the system car-park say beyond the messages of all, on their device buses.

Written by ``make docs`` from ``dbc/car_park.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, Reference, message


@message(frozen=True, slots=True)
class DeskPromise(Message):
    """The same on the display of a desk, beside its text."""

    #: ``origin``: Node-ID that named the car. 0 to 255.
    #: ``number``: Serial number of the car at its origin. 0 to 65535.
    car: Reference
    #: From when this is said to the middle of the interval. 0 to 16777215 ms.
    in_ms: int
    #: As in Promise. 0 to 127500 ms.
    spread_ms: int

"""What the machines of the system car-park say beyond the messages of all.

Written by ``make docs`` from ``dbc/car_park.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, Reference, message


@message(frozen=True, slots=True)
class Promise(Message):
    """When a car that was asked for will be there for its driver, as the customer was first told.

    Once for each time that it is asked for, and again to whoever asks what others know.
    """

    #: ``origin``: Node-ID that named the car. 0 to 255.
    #: ``number``: Serial number of the car at its origin. 0 to 65535.
    car: Reference
    #: The middle of the interval, bus time. 0 to 4294967295 ms.
    ready_ms: int
    #: The car is there within so much of it, before or after, in nine of ten cases; the greatest value: so much or
    #: more. 0 to 127500 ms.
    spread_ms: int

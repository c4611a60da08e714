"""When a car will be fetched, as its driver says beforehand, on their device buses.

Written by ``make docs`` from ``dbc/announce.dbc``: change that file, never this one.
"""

from onboard.contract.announce import FetchWord
from onboard.contract.base import Message, Reference, message


@message(frozen=True, slots=True)
class DeskFetchAnswer(Message):
    """What a desk shows of a time that was announced there, beside its text."""

    #: ``origin``: Node-ID that named the car. 0 to 255.
    #: ``number``: Serial number of the car at its origin. 0 to 65535.
    car: Reference
    #: From when this is said to the time that was announced; the desk has the clock. 0 to 1048575 s.
    in_s: int
    #: Whether it is noted, or why not.
    fetch_word: FetchWord


@message(frozen=True, slots=True)
class DeskFetch(Message):
    """A customer says at the desk when the car will be fetched.

    Sent three times 50 ms apart, as one lost frame must not lose a customer, each time with the two TicketRead of
    what was read.
    """

    #: Counts with that of DeskEvent; the TicketRead of this number belong to it. 0 to 255.
    sequence: int
    #: ``origin``: Of the ticket, the node-ID that named the car. 0 to 255.
    #: ``number``: Of the ticket, the serial number of the car at its origin. 0 to 65535.
    car: Reference
    #: From when this is first said to the time that the customer names; the desk has the clock. 0 to 1048575 s.
    in_s: int

"""When a car will be fetched, as its driver says beforehand.

Written by ``make docs`` from ``dbc/announce.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, Reference, message


class FetchWord(IntEnum):
    """What is said of an announced time.

    A desk or a gateway asks for it, and the compartment at which the car came in has noted it, or why not;
    NO_ANSWER: that one is silent.
    """

    ASKED = 0
    NOTED = 1
    NOT_INSIDE = 2
    PAST = 3
    TOO_FAR = 4
    NO_ANSWER = 5


@message(frozen=True, slots=True)
class FetchTime(Message):
    """When a car will be fetched.

    Whoever was told by its driver asks the compartment at which the car came in, which notes it and says so to all:
    once, and again to whoever asks what others know, until the car has left.
    """

    #: ``origin``: Node-ID that named the car. 0 to 255.
    #: ``number``: Serial number of the car at its origin. 0 to 65535.
    car: Reference
    #: When its driver means to come for it, bus time. 0 to 4294967295 ms.
    fetch_ms: int
    #: Whether it is asked for, noted, or why not.
    fetch_word: FetchWord

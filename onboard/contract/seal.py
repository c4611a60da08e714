"""Seals: proof of who said what on the fleet bus.

Written by ``make docs`` from ``dbc/seal.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, message


class SealWord(IntEnum):
    """What a receiver found of the seal of a frame."""

    GOOD = 0
    UNSEALED = 1
    FALSE_SEAL = 2
    REPLAYED = 3
    NOT_FRESH = 4


@message(frozen=True, slots=True)
class Seal(Message):
    """Right behind the frames that it seals: all that its sender said since its last one, but signs of life.

    Under the group key of the site.
    """

    #: The lowest bits of the sender's running number of seals. 0 to 65535.
    counter: int
    #: BLAKE2s-48 under the group key: docs/seals.md says over what. 0 to 281474976710655.
    tag: int


@message(frozen=True, slots=True)
class SealTo(Message):
    """The same for whoever acts on the frame.

    Said before Seal, right behind a grant or an award, under the key of the two.
    """

    #: As in Seal: one running number for both. 0 to 65535.
    counter: int
    #: BLAKE2s-48 under the key that only sender and taker have. 0 to 281474976710655.
    tag: int


@message(frozen=True, slots=True)
class SealChallenge(Message):
    """Asks for the running number of a node's seals: at a start of all, later of whom the sender cannot follow.

    Not sealed.
    """

    #: Node-ID of whoever is to answer, or 0 for all. 0 to 255.
    whom: int
    #: Chosen by chance, never twice. 0 to 281474976710655.
    nonce: int


@message(frozen=True, slots=True)
class SealAnswer(Message):
    """The 64-bit number of the sender's seals.

    The SealTo behind it is over the nonce, too, so that no answer serves twice.
    """

    #: How many seals the sender has said in this life. 0 to 4294967295.
    number: int
    #: The sender's life: every start of it has a greater one. 1 to 4294967295.
    life: int


@message(frozen=True, slots=True)
class SealFault(Message):
    """Frames of a node that came to nothing, or in a site that watches: would have.

    At most one such word in two seconds.
    """

    #: Node-ID under which the frame was said. 1 to 255.
    about: int
    #: What was wrong with it.
    fault: SealWord
    #: How often since the teller's start, of this node and this fault; it stays at the greatest. 1 to 65535.
    count: int

"""What the fields of the cell system's messages hold, and how they are filled and read."""

import struct

from onboard.contract.cell import GoalPath, OfferNodes, OfferNodesMore

#: Robots that work on the deepest sub-goal already: the core's calls are no deeper (``sub_calls.MAX_DEPTH``).
MAX_PATH = 7
#: As deep goals are called for first: where chains of four do, longer ones need not be asked for, and the calls of
#: all that could be tried grow threefold with each level.
FIRST_PATH = 3
#: Robots that can carry one part, one after the other.
MAX_CHAIN = MAX_PATH + 1
#: Robots that ``GoalPath`` names, and ``OfferNodes``; of seven the last is who says ``GoalPath``.
IN_PATH, IN_OFFER = 6, 5


def halves(value: float) -> tuple[int, int]:
    """A double as two words of 32 bits, the upper one first (IEEE 754)."""
    high, low = struct.unpack(">II", struct.pack(">d", value))
    return high, low


def from_halves(high: int, low: int) -> float:
    """Inverse of ``halves``. What is no finite number comes back as it is: the caller judges."""
    (value,) = struct.unpack(">d", struct.pack(">II", high, low))
    return float(value)


def padded(nodes: tuple[int, ...], count: int) -> tuple[int, ...]:
    """``count`` node-IDs, zeros behind the last of ``nodes``. Raises ``ValueError`` for more."""
    if len(nodes) > count:
        raise ValueError(f"{len(nodes)} robots do not fit into {count} places")
    return (*nodes, *(0,) * (count - len(nodes)))


def path_of(message: GoalPath, level: int) -> tuple[int, ...]:
    """The robots that work on a goal of ``level``, without the empty places."""
    one = message
    named = tuple(node for node in (one.node1, one.node2, one.node3, one.node4, one.node5, one.node6) if node)
    return (*named, message.sender) if level > IN_PATH else named


def offered_by(message: OfferNodes, more: OfferNodesMore | None) -> tuple[int, ...]:
    """All robots of an offer, without the empty places; none where some are missing."""
    every = message.node1, message.node2, message.node3, message.node4, message.node5
    if not message.node5:
        return tuple(node for node in every if node)
    return () if more is None else tuple(node for node in (*every, more.node6, more.node7, more.node8) if node)

"""What the fields of the cell system's messages hold, and how they are filled and read."""

import struct

from onboard.contract.cell import GoalPath, OfferNodes

#: Robots that one frame can name: the deepest sub-goal has as many predecessors at most.
MAX_PATH = 5


def halves(value: float) -> tuple[int, int]:
    """A double as two words of 32 bits, the upper one first (IEEE 754)."""
    high, low = struct.unpack(">II", struct.pack(">d", value))
    return high, low


def from_halves(high: int, low: int) -> float:
    """Inverse of ``halves``. What is no finite number comes back as it is: the caller judges."""
    (value,) = struct.unpack(">d", struct.pack(">II", high, low))
    return float(value)


def five(nodes: tuple[int, ...]) -> tuple[int, int, int, int, int]:
    """Up to five node-IDs, zeros behind the last. Raises ``ValueError`` for more."""
    if len(nodes) > MAX_PATH:
        raise ValueError(f"{len(nodes)} robots do not fit into one frame")
    one, two, three, four, fifth = (*nodes, *(0,) * (MAX_PATH - len(nodes)))
    return one, two, three, four, fifth


def nodes_of(message: GoalPath | OfferNodes) -> tuple[int, ...]:
    """Inverse of ``five``."""
    every = (message.node1, message.node2, message.node3, message.node4, message.node5)
    return tuple(node for node in every if node)

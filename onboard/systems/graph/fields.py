"""What the fields of the graph system's messages hold, and how they are filled and read."""

from onboard.contract.graph import VisitList
from onboard.contract.graph_device import VisitKey

#: No node.
NO_NODE = 255


def stops_of(message: VisitList | VisitKey) -> tuple[int, ...]:
    """The nodes to visit, in turn."""
    every = (message.stop1, message.stop2, message.stop3, message.stop4, message.stop5)
    return tuple(node for node in every if node != NO_NODE)


def five(stops: tuple[int, ...]) -> tuple[int, int, int, int, int]:
    """Inverse of ``stops_of``. Raises ``ValueError`` for more than five stops."""
    if len(stops) > 5:
        raise ValueError(f"{len(stops)} stops do not fit into one frame")
    one, two, three, four, fifth = (*stops, *(NO_NODE,) * (5 - len(stops)))
    return one, two, three, four, fifth

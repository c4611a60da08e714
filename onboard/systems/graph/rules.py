"""What a node agent answers (rows G15 to G22): pure rules over the edges that are taken and who wants what.

Four rule sets. ``PAPER``: an edge is granted where it is free. ``KEEP``: besides, a node with traffic at it keeps its
last free edge and refuses it to the neighbour (row G21). ``KEEP_ON_NOTICE`` is that rule to the letter: a node counts
when a neighbour has reserved an edge to it, and lets go what it keeps when one has released an edge.
``EDGE_AND_NODE``: an edge is granted with a slot in the node behind it, so nobody ever waits on an edge: what a robot
holds while it waits is no edge (decision 14).
"""

from collections.abc import Container
from enum import Enum
from typing import NamedTuple

from onboard.contract.codes import Reason
from onboard.core.mirror import Mirror
from onboard.systems.graph.network import Graph, edge


class Rules(Enum):
    """Rule sets, as the site file and the command line name them."""

    PAPER = "paper"
    KEEP = "keep"
    KEEP_ON_NOTICE = "keep-on-notice"
    EDGE_AND_NODE = "edge-and-node"


class Heading(NamedTuple):
    """A robot on the way from ``start`` to ``end``, which it has not entered; ``wants`` is the node after, or None.

    A robot that stands in a node has ``start`` below 0.
    """

    start: int
    end: int
    wants: int | None


def free_edges(graph: Graph, taken: Container[tuple[int, int]], node: int) -> list[int]:
    """The neighbours to which a node has a free edge, lowest first."""
    return [other for other in graph.neighbours[node] if edge(node, other) not in taken]


def kept_edge(graph: Graph, taken: Container[tuple[int, int]], node: int) -> int | None:
    """The neighbour whose edge a node keeps for its own needs: its last free one, if there is traffic at it (G21)."""
    free = free_edges(graph, taken, node)
    return free[0] if len(free) == 1 and len(graph.neighbours[node]) > 1 else None


def may_enter(graph: Graph, taken: Container[tuple[int, int]], node: int, after: int, rules: Rules) -> bool:
    """Whether the node grants the edge to ``after`` (rows G17, G18, G21).

    A slot behind it, and what the other end keeps since a notice, are the caller's matter.
    """
    if edge(node, after) in taken:
        return False
    return rules is not Rules.KEEP or kept_edge(graph, taken, after) != node


def are_head_on(one: Heading, other: Heading | None) -> bool:
    """Whether two robots before one node want each other's edges: neither can ever go on (row G19)."""
    return (
        other is not None
        and one.start >= 0
        and one.end == other.end
        and one.wants == other.start
        and other.wants == one.start
    )


def other_edges(
    graph: Graph, taken: Container[tuple[int, int]], node: int, came_from: int, rules: Rules
) -> tuple[int, ...]:
    """Where "take another edge" may send a robot: every edge that the node would grant (row G19)."""
    return tuple(
        after for after in graph.neighbours[node] if after != came_from and may_enter(graph, taken, node, after, rules)
    )


def is_of_another_site(mirror: Mirror, node: int) -> bool:
    """Whether a machine's heartbeat names a site that does not count for mine: its map is wrong or old (row G27)."""
    obstacle = mirror.aside.get(node)
    return obstacle is not None and obstacle.reason is Reason.OTHER_SITE

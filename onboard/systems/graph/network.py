"""The graph that robots move on, and shortest ways on it (rows G01, G03, G09, G12).

Nodes are numbers 0 to 254; an edge is the pair of its ends, the lower first; a *direction* is an edge with a sense. As
no robot reverses, ways are sought from direction to direction, not from node to node.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from onboard.ways.network import Network

#: Ends of an edge, lower node first.
Edge = tuple[int, int]
#: An edge and the sense in which it is travelled.
Direction = tuple[int, int]

#: A robot that stands in a node came from nowhere: it may leave by every edge.
NOWHERE = -1


def edge(one: int, other: int) -> Edge:
    """The edge between two nodes."""
    return (one, other) if one < other else (other, one)


@dataclass(frozen=True)
class Graph:
    """An undirected weighted graph; ``lengths_mm`` are above 0 and their keys edges."""

    lengths_mm: Mapping[Edge, int]

    @cached_property
    def nodes(self) -> tuple[int, ...]:
        """All nodes that an edge ends at, lowest number first."""
        return tuple(sorted({node for ends in self.lengths_mm for node in ends}))

    @cached_property
    def neighbours(self) -> dict[int, tuple[int, ...]]:
        """The nodes at the other ends of a node's edges, lowest first."""
        found: dict[int, list[int]] = {node: [] for node in self.nodes}
        for one, other in self.lengths_mm:
            found[one].append(other)
            found[other].append(one)
        return {node: tuple(sorted(ends)) for node, ends in found.items()}

    @cached_property
    def dead_ends(self) -> tuple[int, ...]:
        """Nodes with fewer than two edges (row G02): without reversing nobody comes out of them."""
        return tuple(node for node, ends in self.neighbours.items() if len(ends) < 2)

    def length_mm(self, one: int, other: int) -> int:
        """Length of the edge between two neighbours. Raises ``KeyError`` where there is none."""
        return self.lengths_mm[edge(one, other)]

    # --- ways --------------------------------------------------------------------------------------------------

    @cached_property
    def nodes_network(self) -> Network[int]:
        """Nodes and edges as places and ways, mm: what is joined, for whoever looks at no robot's nose."""
        return Network({node: self._ahead(NOWHERE, node) for node in self.nodes})

    @cached_property
    def network(self) -> Network[Direction]:
        """Directions, and standing in a node, as places; on each one way to every edge but the one come by, mm."""
        starts = [(NOWHERE, node) for node in self.nodes]
        directions = [*self.lengths_mm, *((other, one) for one, other in self.lengths_mm), *starts]
        ways = {(one, node): [((node, after), mm) for after, mm in self._ahead(one, node)] for one, node in directions}
        return Network(ways, {here: edge(*here) for here in directions if here[0] != NOWHERE})

    def _ahead(self, came_from: int, node: int) -> list[tuple[int, int]]:
        return [(after, self.length_mm(node, after)) for after in self.neighbours[node] if after != came_from]

    def to_go_mm(self, goal: int) -> dict[Direction, int]:
        """How far it is to a node from the end of each direction from which a way leads there; kept."""
        found = self._to_go.get(goal)
        if found is None:
            there = [(one, goal) for one in (NOWHERE, *self.neighbours[goal])]
            found = self._to_go[goal] = self.network.costs_to(there)
        return found

    def way(
        self, came_from: int, node: int, goal: int, extra_mm: Mapping[Direction, int] | None = None
    ) -> tuple[int, ...] | None:
        """The nodes of a shortest way from ``node`` to ``goal``, both included; None where there is no way.

        A robot that comes from ``came_from`` (or ``NOWHERE``) does not reverse. ``extra_mm`` is what some directions
        cost more. Of equal ways the one by the lowest nodes.
        """
        way = self.network.way((came_from, node), self.to_go_mm(goal), extra_mm or {})
        return None if way is None else tuple(end for _, end in way)

    def next_node(self, came_from: int, node: int, goal: int) -> int | None:
        """The node after ``node`` on a shortest way. None at the goal, or where there is no way without reversing."""
        key = (came_from, node, goal)
        if key not in self._next:
            way = self.way(came_from, node, goal)
            self._next[key] = way[1] if way is not None and node != goal else None
        return self._next[key]

    def distance_mm(self, came_from: int, node: int, goal: int) -> int | None:
        """Length of a shortest way; 0 at the goal, None where there is no way."""
        return self.to_go_mm(goal).get((came_from, node))

    @cached_property
    def _next(self) -> dict[tuple[int, int, int], int | None]:
        return {}

    @cached_property
    def _to_go(self) -> dict[int, dict[Direction, int]]:
        return {}


def ring(nodes: int, length_mm: int = 1) -> Graph:
    """A ring of at least 3 nodes."""
    return Graph({edge(node, (node + 1) % nodes): length_mm for node in range(nodes)})


def grid(rows: int, columns: int, length_mm: int = 1) -> Graph:
    """A grid; nodes are numbered row by row."""
    right = {(n, n + 1): length_mm for n in range(rows * columns) if (n + 1) % columns}
    down = {(n, n + columns): length_mm for n in range((rows - 1) * columns)}
    return Graph({**right, **down})


def cube(dimensions: int, length_mm: int = 1) -> Graph:
    """A hypercube: 2 to the ``dimensions`` nodes, 2 or more, each joined to those that differ in one binary digit."""
    nodes, digits = range(1 << dimensions), [1 << digit for digit in range(dimensions)]
    return Graph({edge(node, node ^ digit): length_mm for node in nodes for digit in digits})


def complete(nodes: int, length_mm: int = 1) -> Graph:
    """Every node joined to every other."""
    return Graph({(one, other): length_mm for one in range(nodes) for other in range(one + 1, nodes)})

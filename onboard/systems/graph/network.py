"""The graph that robots move on, and shortest ways on it (rows G01, G03, G09, G12).

Nodes are numbers 0 to 254; an edge is the pair of its ends, the lower first; a *direction* is an edge with a sense. As
no robot reverses, ways are sought from direction to direction: Floyd's algorithm (1962) over directions, not nodes.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

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

    def next_node(self, came_from: int, node: int, goal: int) -> int | None:
        """Where a robot that comes to ``node`` from ``came_from`` (or ``NOWHERE``) goes next on a shortest way.

        Of equal ways the one by the lowest next node. None at the goal, or where there is no way without reversing.
        """
        key = (came_from, node, goal)
        if key not in self._next:
            found = [
                (self.length_mm(node, after) + rest, after)
                for after in self.neighbours[node]
                if after != came_from and (rest := self._to_go.get((node, after), {}).get(goal)) is not None
            ]
            self._next[key] = min(found)[1] if found and node != goal else None
        return self._next[key]

    def way(self, came_from: int, node: int, goal: int) -> tuple[int, ...] | None:
        """The nodes of a shortest way from ``node`` to ``goal``, both included; None where there is no way."""
        nodes = [node]
        while node != goal:
            after = self.next_node(came_from, node, goal)
            if after is None:
                return None
            came_from, node = node, after
            nodes.append(node)
        return tuple(nodes)

    def distance_mm(self, came_from: int, node: int, goal: int) -> int | None:
        """Length of a shortest way; 0 at the goal, None where there is no way."""
        nodes = self.way(came_from, node, goal)
        return None if nodes is None else sum(self.length_mm(*ends) for ends in pairwise(nodes))

    @cached_property
    def _next(self) -> dict[tuple[int, int, int], int | None]:
        return {}

    @cached_property
    def _to_go(self) -> dict[Direction, dict[int, int]]:
        """By direction and goal, how far it is from the direction's end on."""
        return {
            (start, end): {
                goal: min(distances[into] for into in distances if into[1] == goal)
                for goal in {node for _, node in distances}
            }
            for (start, end), distances in self._floyd()
        }

    def _floyd(self) -> Iterator[tuple[Direction, dict[Direction, int]]]:
        """Floyd's algorithm: for each direction the length from its end to the end of every direction within reach."""
        directions = [*self.lengths_mm, *((other, one) for one, other in self.lengths_mm)]
        table: dict[Direction, dict[Direction, int]] = {
            (one, other): {
                (other, after): self.length_mm(other, after) for after in self.neighbours[other] if after != one
            }
            for one, other in directions
        }
        for one, other in directions:
            table[one, other][one, other] = 0
        for middle in directions:
            onward = table[middle].items()
            for row in table.values():
                first = row.get(middle)
                if first is None:
                    continue
                for last, length in list(onward):
                    if first + length < row.get(last, first + length + 1):
                        row[last] = first + length
        yield from table.items()


def ring(nodes: int, length_mm: int = 1) -> Graph:
    """A ring of at least 3 nodes."""
    return Graph({edge(node, (node + 1) % nodes): length_mm for node in range(nodes)})


def grid(rows: int, columns: int, length_mm: int = 1) -> Graph:
    """A grid; nodes are numbered row by row."""
    right = {(n, n + 1): length_mm for n in range(rows * columns) if (n + 1) % columns}
    down = {(n, n + columns): length_mm for n in range((rows - 1) * columns)}
    return Graph({**right, **down})


def complete(nodes: int, length_mm: int = 1) -> Graph:
    """Every node joined to every other."""
    return Graph({(one, other): length_mm for one in range(nodes) for other in range(one + 1, nodes)})

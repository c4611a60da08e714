"""Places and the ways between them: the one form in which planner, refuges and proofs know where machines move.

A place is whatever can be hashed and ordered: a slot of an alley, a cell of a floor, a direction of an edge on which
nobody reverses. What a way costs is above 0, in the unit of who made the network (us, mm, steps).
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property
from heapq import heappop, heappush
from typing import Any, Generic, Protocol, TypeVar


class _Ordered(Protocol):
    def __lt__(self, other: Any, /) -> bool: ...


Place = TypeVar("Place", bound=_Ordered)
#: What a way costs where it costs no more than else.
_NOTHING_MORE: Mapping[Any, int] = {}


class Network(Generic[Place]):
    """``ways[place]`` are the places one way away with what it costs; a one-way way is not named back.

    ``takes`` says what standing at a place takes where that is not the place alone: two bodies exclude each other at
    places that take the same.
    """

    def __init__(
        self, ways: Mapping[Place, Sequence[tuple[Place, int]]], takes: Mapping[Place, Place] | None = None
    ) -> None:
        self.ways = ways
        self.takes: Mapping[Place, Place] = takes if takes is not None else {}

    @cached_property
    def back(self) -> Mapping[Place, Sequence[tuple[Place, int]]]:
        """The places from which a way leads to each, with what it costs."""
        found: dict[Place, list[tuple[Place, int]]] = {place: [] for place in self.ways}
        for here, ahead in self.ways.items():
            for there, cost in ahead:
                found[there].append((here, cost))
        return found

    # --- what is reached ---------------------------------------------------------------------------------------

    def from_any(self, starts: Iterable[Place], *, closed: Collection[Place] = ()) -> frozenset[Place]:
        """Places to which one comes from any of ``starts``; not those that are closed, nor through them."""
        return _spread(starts, self.ways, closed)

    def to_any(self, goals: Iterable[Place], *, closed: Collection[Place] = ()) -> frozenset[Place]:
        """Places from which one comes to any of ``goals``."""
        return _spread(goals, self.back, closed)

    def ground(self, hub: Collection[Place], *, closed: Collection[Place] = ()) -> frozenset[Place]:
        """All between which one comes to and fro, any of ``hub`` among them."""
        return self.from_any(hub, closed=closed) & self.to_any(hub, closed=closed)

    # --- shortest ways -----------------------------------------------------------------------------------------

    def costs_to(self, goals: Mapping[Place, int] | Iterable[Place]) -> dict[Place, int]:
        """The least cost from each place to any of ``goals``, which may cost something themselves (Dijkstra 1959).

        Places from which no way leads there are left out. Places of one cost are looked at together, so that ways which
        all cost the same are found as fast as by breadth first.
        """
        found: dict[Place, int] = {}
        costs = goals if isinstance(goals, Mapping) else dict.fromkeys(goals, 0)
        border: dict[int, list[Place]] = {}
        for goal, cost in costs.items():
            border.setdefault(cost, []).append(goal)
        queue, back = sorted(border), self.back
        while queue:
            reached = heappop(queue)
            for here in border.pop(reached):
                if here in found:
                    continue
                found[here] = reached
                for before, more in back.get(here, ()):
                    if before in found:
                        continue
                    cost = reached + more
                    if cost in border:
                        border[cost].append(before)
                    else:
                        border[cost] = [before]
                        heappush(queue, cost)
        return found

    def way(
        self, start: Place, costs_to: Mapping[Place, int], more: Mapping[Place, int] = _NOTHING_MORE
    ) -> tuple[Place, ...] | None:
        """The cheapest way to where ``costs_to`` is 0, both ends included; None where no way leads there.

        To come to a place of ``more`` costs so much more. Of ways that cost the same the one by the lowest places. Best
        first by what is known to be left (A*; Hart, Nilsson and Raphael 1968).
        """
        if start not in costs_to:
            return None
        queue: list[tuple[int, tuple[Place, ...]]] = [(costs_to[start], (start,))]
        closed: set[Place] = set()
        while queue:
            least, way = heappop(queue)
            here = way[-1]
            left = costs_to[here]
            if not left:
                return way
            if here in closed:
                continue
            closed.add(here)
            for there, cost in self.ways[here]:
                left_there = costs_to.get(there)
                if left_there is not None and there not in closed:
                    heappush(queue, (least - left + cost + more.get(there, 0) + left_there, (*way, there)))
        return None


def _spread(
    starts: Iterable[Place], ways: Mapping[Place, Sequence[tuple[Place, int]]], closed: Collection[Place]
) -> frozenset[Place]:
    ahead = [start for start in starts if start in ways]
    found: set[Place] = set()
    while ahead:
        here = ahead.pop()
        if here not in found and here not in closed:
            found.add(here)
            ahead += [there for there, _ in ways[here]]
    return frozenset(found)

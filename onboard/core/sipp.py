"""Safe-interval path planning (SIPP; Phillips and Likhachev 2011) with whole rest-to-rest moves as edges.

A state is (phase, segment, safe interval), reached standing at the earliest possible time; waiting inside the interval
is free. A move departs as early as every window that the body sweeps lies in a safe interval, so following another
machine with a headway comes out by itself. Phases count the visits made; after the last one the route must end in a
refuge that is safe for ever.

Best first by (end of the last visit, time, travel, moves), the first a lower bound until the visits are made. A move is
queued under a bound from the first segments that it sweeps, and the rest is looked at only when its turn comes (lazy
evaluation of edges; Cohen, Phillips and Likhachev 2014): most never do.
"""

from heapq import heappop, heappush
from typing import NamedTuple

from onboard.core.codes import LegAction
from onboard.core.departures import Departures, first_ms
from onboard.core.kinematics import ceil_ms
from onboard.core.reservations import FOREVER, Interval, Reservations
from onboard.core.roads import Move, Roads, roads_of
from onboard.core.site import Segment, Site


class Visit(NamedTuple):
    """Stand at ``segment`` for ``dwell_us``, beginning not before ``not_before_us`` (bus time)."""

    segment: Segment
    dwell_us: int
    not_before_us: int = 0


class RouteLeg(NamedTuple):
    """One leg ``[begin_us, end_us)``, both whole milliseconds; WORK is a visit's dwell, STAND a wait.

    TRAVEL with equal indices is the hop from the segment before it through a junction onto this track.
    """

    action: LegAction
    track: int
    from_index: int
    to_index: int
    begin_us: int
    end_us: int


class Route(NamedTuple):
    """A plan: its legs, when each visit ends, when the last one ends, and what the search cost.

    Without visits ``finish_us`` is when the route ends in a refuge.
    """

    legs: tuple[RouteLeg, ...]
    visit_ends_us: tuple[int, ...]
    finish_us: int
    expansions: int


class NoRoute(NamedTuple):
    """No plan within the bound of expansions, and why."""

    reason: str
    expansions: int


def free_flow_us(site: Site, start: Segment, start_us: int, visits: tuple[Visit, ...]) -> int:
    """When the last visit would end with nobody in the way: the least of all routes. FOREVER where out of reach."""
    roads = roads_of(site)
    time_us, here = ceil_ms(start_us), start
    for visit in visits:
        if not (roads.knows(here) and roads.knows(visit.segment)):
            return FOREVER
        way_us = roads.shortest_us(here, visit.segment)
        if way_us >= FOREVER:
            return FOREVER
        time_us = max(time_us + way_us, ceil_ms(visit.not_before_us)) + ceil_ms(visit.dwell_us)
        here = visit.segment
    return time_us


def plan_route(
    site: Site,
    reservations: Reservations,
    owner: int,
    start: Segment,
    start_us: int,
    visits: tuple[Visit, ...],
    refuges: frozenset[Segment],
    max_expansions: int,
) -> Route | NoRoute:
    """The route with the earliest end of the last visit, from standing at ``start`` at bus time ``start_us``.

    Equal ends go to the earlier arrival in a refuge, then to less travel and fewer moves among those that come to the
    same states at the same times. Windows of ``owner`` itself are no obstacle. Bounded by ``max_expansions``, never by
    wall time; what is still equal is taken in the order of discovery, which is fixed.
    """
    start_us = ceil_ms(start_us)
    roads = roads_of(site)
    if not roads.knows(start) or free_flow_us(site, start, start_us, visits) >= FOREVER:
        return NoRoute("a visit is out of reach of the start", 0)
    departures = Departures(roads, reservations, owner, start_us)
    interval = departures.standing_at(start, start_us)
    if interval is None:
        return NoRoute(f"the start {start} is reserved by another machine", 0)
    root = _Node(0, start, interval, start_us, None, LegAction.STAND, start_us, (), 0, 0)
    return _Search(roads, departures, visits, refuges).run(root, max_expansions)


class _Node(NamedTuple):
    """A state reached at ``time_us`` from ``parent`` by a leg that began at ``begin_us``."""

    phase: int
    segment: Segment
    interval: Interval
    time_us: int
    parent: "_Node | None"
    action: LegAction
    begin_us: int
    visit_ends_us: tuple[int, ...]
    travel_mm: int
    moves: int


#: (end of the last visit, time, travel, moves, order of discovery): the last is unique.
_Key = tuple[int, int, int, int, int]


class _Search:
    """One search.

    ``_tails`` holds for each phase (work, floor): whoever arrives at its visit at t ends the last visit at
    max(t + work, floor) with nobody in the way.
    """

    def __init__(
        self, roads: Roads, departures: Departures, visits: tuple[Visit, ...], refuges: frozenset[Segment]
    ) -> None:
        self.roads = roads
        self.departures = departures
        self.visits = visits
        self.refuges = refuges
        self._tails = _tails(roads, visits)
        self._way_us: list[dict[Segment, int]] = [{} for _ in visits]
        self._queue: list[tuple[_Key, _Node, tuple[Move, list[Interval]] | None]] = []
        self._pushed = 0
        self._closed: dict[tuple[int, Segment, Interval], int] = {}

    def run(self, root: _Node, max_expansions: int) -> Route | NoRoute:
        """Search from ``root``; see ``plan_route``. The queue holds nodes, and nodes with a move still to be tried."""
        self._push(root)
        expansions = 0
        while self._queue:
            _, node, untried = heappop(self._queue)
            if untried is not None:
                self._try(node, *untried)
                continue
            if self._is_beaten(node):
                continue
            if self._is_goal(node):
                finish_us = node.visit_ends_us[-1] if node.visit_ends_us else node.time_us
                return Route(tuple(_legs(node)), node.visit_ends_us, finish_us, expansions)
            if expansions >= max_expansions:
                return NoRoute("the search's bound of expansions is reached", expansions)
            expansions += 1
            self._closed[node[:3]] = node.time_us
            self._expand(node)
        return NoRoute("no order of waits and moves leads to the goal and a refuge", expansions)

    def _is_beaten(self, node: _Node) -> bool:
        """Whether the state was left before at the same time or earlier.

        A state can come up again earlier after the last visit only: by a route that ends that visit later.
        """
        closed_us = self._closed.get(node[:3])
        return closed_us is not None and closed_us <= node.time_us

    def _is_goal(self, node: _Node) -> bool:
        return node.phase == len(self.visits) and node.segment in self.refuges and node.interval.to_us >= FOREVER

    def _expand(self, node: _Node) -> None:
        """Queue the dwell of the next visit, if it is here, and every move under the least time that it takes."""
        if node.phase < len(self.visits) and self.visits[node.phase].segment == node.segment:
            self._push_dwell(node, self.visits[node.phase])
        within = Interval(node.time_us, node.interval.to_us)
        for move, choice in self.departures.moves(node.segment, within):
            arrival_us = choice[0].from_us + move.duration_us
            finish_us = self._finish_us(node, move.destination, arrival_us)
            self._pushed += 1
            key = (finish_us, arrival_us, node.travel_mm + move.distance_mm, node.moves + 1, self._pushed)
            heappush(self._queue, (key, node, (move, choice)))

    def _push_dwell(self, node: _Node, visit: Visit) -> None:
        begin_us = max(node.time_us, ceil_ms(visit.not_before_us))
        end_us = begin_us + ceil_ms(visit.dwell_us)
        if end_us <= node.interval.to_us:
            self._push(
                node._replace(
                    phase=node.phase + 1,
                    time_us=end_us,
                    parent=node,
                    action=LegAction.WORK,
                    begin_us=begin_us,
                    visit_ends_us=(*node.visit_ends_us, end_us),
                )
            )

    def _try(self, node: _Node, move: Move, choice: list[Interval]) -> None:
        """Queue the earliest arrival of a move in each safe interval of its destination."""
        reached: Interval | None = None
        for depart_us in first_ms(self.departures.safe(node.segment, move, choice)):
            arrival_us = depart_us + move.duration_us
            interval = self.departures.standing_at(move.destination, arrival_us)
            if interval is None or interval == reached:
                continue
            reached = interval
            self._push(
                _Node(
                    node.phase,
                    move.destination,
                    interval,
                    arrival_us,
                    node,
                    LegAction.TRAVEL,
                    depart_us,
                    node.visit_ends_us,
                    node.travel_mm + move.distance_mm,
                    node.moves + 1,
                )
            )

    def _push(self, node: _Node) -> None:
        if self._is_beaten(node):
            return
        self._pushed += 1
        finish_us = self._finish_us(node, node.segment, node.time_us)
        heappush(self._queue, ((finish_us, node.time_us, node.travel_mm, node.moves, self._pushed), node, None))

    def _finish_us(self, node: _Node, segment: Segment, time_us: int) -> int:
        """Earliest end of the last visit that is still possible from standing at ``segment`` at ``time_us``.

        Without visits all routes are equal.
        """
        if node.phase == len(self.visits):
            return node.visit_ends_us[-1] if node.visit_ends_us else 0
        ways = self._way_us[node.phase]
        way_us = ways.get(segment)
        if way_us is None:
            way_us = ways[segment] = self.roads.shortest_us(segment, self.visits[node.phase].segment)
        work_us, floor_us = self._tails[node.phase]
        return max(time_us + way_us + work_us, floor_us)


def _tails(roads: Roads, visits: tuple[Visit, ...]) -> list[tuple[int, int]]:
    """For each phase the constants of ``_Search``, from the last visit backwards."""
    tails: list[tuple[int, int]] = []
    work_us = floor_us = 0
    after: Segment | None = None
    for visit in reversed(visits):
        way_us = 0 if after is None else roads.shortest_us(visit.segment, after)
        work_us += ceil_ms(visit.dwell_us) + way_us
        floor_us = max(floor_us, ceil_ms(visit.not_before_us) + work_us)
        tails.append((work_us, floor_us))
        after = visit.segment
    return tails[::-1]


def _legs(node: _Node) -> list[RouteLeg]:
    """The legs from the start to ``node``, waits made explicit.

    A route that sets off with a hop gets a first leg of no length, so that it tells where the hop begins.
    """
    legs: list[RouteLeg] = []
    while node.parent is not None:
        before = node.parent
        here, there = before.segment, node.segment
        hops = here.track != there.track
        from_index = there.index if hops else here.index
        legs.append(RouteLeg(node.action, there.track, from_index, there.index, node.begin_us, node.time_us))
        if node.begin_us > before.time_us or (hops and before.parent is None):
            legs.append(RouteLeg(LegAction.STAND, here.track, here.index, here.index, before.time_us, node.begin_us))
        node = before
    return legs[::-1]

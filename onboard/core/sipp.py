"""Safe-interval path planning (SIPP; Phillips and Likhachev 2011) with whole rest-to-rest moves as edges.

A state is (phase, segment, safe interval), reached standing at the earliest possible time; waiting inside the interval
is free. A move departs as early as every window that the body sweeps lies in a safe interval, so following another
machine with a headway comes out by itself. Phases count the visits made; after the last one the route must end in a
refuge that is safe for ever.

Best first by (end of the last visit, time, travel, moves), the first a lower bound until the visits are made. A move is
queued under the time that it takes with nobody in the way and checked only when its turn comes (lazy evaluation of
edges; Cohen, Phillips and Likhachev 2014): most never do.
"""

from bisect import bisect_left
from heapq import heappop, heappush
from typing import NamedTuple

from onboard.core.codes import LegAction
from onboard.core.kinematics import ceil_ms
from onboard.core.occupancy import standing_segments
from onboard.core.reservations import FOREVER, Interval, Reservations
from onboard.core.roads import Move, Roads, Swept, roads_of
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
    if free_flow_us(site, start, start_us, visits) >= FOREVER or not roads_of(site).knows(start):
        return NoRoute("a visit is out of reach of the start", 0)
    safe = _SafeIntervals(site, reservations, owner, start_us)
    first = next((gap for gap in safe.standing(start) if gap.from_us <= start_us < gap.to_us), None)
    if first is None:
        return NoRoute(f"the start {start} is reserved by another machine", 0)
    return _Search(roads_of(site), safe, visits, refuges).run(start, start_us, first, max_expansions)


class _SafeIntervals:
    """Safe intervals of one search, each looked up once."""

    def __init__(self, site: Site, reservations: Reservations, owner: int, start_us: int) -> None:
        self._site = site
        self._reservations = reservations
        self._owner = owner
        self._start_us = start_us
        self._always = [Interval(start_us, FOREVER)]
        self._gaps: dict[Segment, list[Interval]] = {}
        self._standing: dict[Segment, list[Interval]] = {}

    def gaps(self, segment: Segment) -> list[Interval]:
        """When nobody else is in one segment."""
        found = self._gaps.get(segment)
        if found is None:
            found = self._reservations.safe_intervals(segment, self._owner, self._start_us)
            found = self._gaps[segment] = self._always if found == self._always else found
        return found

    def standing(self, segment: Segment) -> list[Interval]:
        """When a body may stand at a segment: all that it touches there must be free."""
        found = self._standing.get(segment)
        if found is None:
            touched = standing_segments(self._site, segment)
            found = self.gaps(touched[0])
            for other in touched[1:]:
                found = _intersect(found, self.gaps(other))
            self._standing[segment] = found
        return found

    def departure_us(self, not_before_us: int, latest_us: int, swept: list[Swept]) -> int | None:
        """Earliest whole millisecond from which every swept window lies in one safe interval, or None.

        Each correction moves the departure to the begin of a later gap, so the loop ends.
        """
        depart_us = not_before_us
        before_us = None
        while depart_us != before_us:
            before_us = depart_us
            for segment, enter_us, leave_us in swept:
                gaps = self.gaps(segment)
                if gaps is self._always:
                    continue
                gap_us = _gap_begin_us(gaps, depart_us + enter_us, depart_us + leave_us)
                if gap_us > depart_us + enter_us:
                    depart_us = ceil_ms(gap_us - enter_us)
                    if depart_us > latest_us:
                        return None
        return depart_us


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
        self, roads: Roads, safe: _SafeIntervals, visits: tuple[Visit, ...], refuges: frozenset[Segment]
    ) -> None:
        self.roads = roads
        self.safe = safe
        self.visits = visits
        self.refuges = refuges
        self._tails = _tails(roads, visits)
        self._way_us: list[dict[Segment, int]] = [{} for _ in visits]
        self._queue: list[tuple[_Key, _Node, Move | None]] = []
        self._pushed = 0
        self._closed: dict[tuple[int, Segment, Interval], int] = {}

    def run(self, start: Segment, start_us: int, interval: Interval, max_expansions: int) -> Route | NoRoute:
        """Search from standing at ``start``; see ``plan_route``."""
        self._push(_Node(0, start, interval, start_us, None, LegAction.STAND, start_us, (), 0, 0), None)
        expansions = 0
        while self._queue:
            _, node, unchecked = heappop(self._queue)
            if self._is_beaten(node):
                continue
            if unchecked is not None and not self._check(node, unchecked):
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

        Only after the last visit can a state come up again earlier: under a later end of that visit.
        """
        closed_us = self._closed.get(node[:3])
        return closed_us is not None and closed_us <= node.time_us

    def _is_goal(self, node: _Node) -> bool:
        return node.phase == len(self.visits) and node.segment in self.refuges and node.interval.to_us >= FOREVER

    def _expand(self, node: _Node) -> None:
        """Queue the dwell of the next visit, if it is here, and every move."""
        if node.phase < len(self.visits) and self.visits[node.phase].segment == node.segment:
            self._push_dwell(node, self.visits[node.phase])
        for move in self.roads.moves(node.segment):
            for gap in self.safe.standing(move.destination):
                begin_us = max(node.time_us, ceil_ms(gap.from_us - move.duration_us))
                if begin_us < node.interval.to_us and begin_us + move.duration_us < gap.to_us:
                    self._push_move(node, move, gap, begin_us)

    def _push_dwell(self, node: _Node, visit: Visit) -> None:
        begin_us = max(node.time_us, ceil_ms(visit.not_before_us))
        end_us = begin_us + ceil_ms(visit.dwell_us)
        if end_us <= node.interval.to_us:
            ends = (*node.visit_ends_us, end_us)
            done = node._replace(
                phase=node.phase + 1,
                time_us=end_us,
                parent=node,
                action=LegAction.WORK,
                begin_us=begin_us,
                visit_ends_us=ends,
            )
            self._push(done, None)

    def _push_move(self, node: _Node, move: Move, gap: Interval, begin_us: int) -> None:
        arrival_us = begin_us + move.duration_us
        there = _Node(
            node.phase,
            move.destination,
            gap,
            arrival_us,
            node,
            LegAction.TRAVEL,
            begin_us,
            node.visit_ends_us,
            node.travel_mm + move.distance_mm,
            node.moves + 1,
        )
        if not self._is_beaten(there):
            self._push(there, move)

    def _check(self, node: _Node, move: Move) -> bool:
        """Whether the move can depart when it was queued for; if only later, it is queued again."""
        assert node.parent is not None
        latest_us = min(node.parent.interval.to_us, node.interval.to_us - move.duration_us) - 1
        swept = self.roads.swept(node.parent.segment, move.destination)
        depart_us = self.safe.departure_us(node.begin_us, latest_us, swept)
        if depart_us is None:
            return False
        if depart_us == node.begin_us:
            return True
        self._push(node._replace(begin_us=depart_us, time_us=depart_us + move.duration_us), None)
        return False

    def _push(self, node: _Node, unchecked: Move | None) -> None:
        self._pushed += 1
        key = (self._finish_us(node), node.time_us, node.travel_mm, node.moves, self._pushed)
        heappush(self._queue, (key, node, unchecked))

    def _finish_us(self, node: _Node) -> int:
        """Earliest end of the last visit that is still possible; without visits all routes are equal."""
        if node.phase == len(self.visits):
            return node.visit_ends_us[-1] if node.visit_ends_us else 0
        ways = self._way_us[node.phase]
        way_us = ways.get(node.segment)
        if way_us is None:
            way_us = ways[node.segment] = self.roads.shortest_us(node.segment, self.visits[node.phase].segment)
        work_us, floor_us = self._tails[node.phase]
        return max(node.time_us + way_us + work_us, floor_us)


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


def _gap_begin_us(gaps: list[Interval], enter_us: int, leave_us: int) -> int:
    """Begin of the first gap that can hold a window of this length at ``enter_us`` or later; FOREVER if none can."""
    length_us = leave_us - enter_us
    for place in range(bisect_left(gaps, leave_us, key=_end_us), len(gaps)):
        gap = gaps[place]
        if gap.to_us - max(gap.from_us, enter_us) >= length_us:
            return gap.from_us
    return FOREVER


def _end_us(gap: Interval) -> int:
    return gap.to_us


def _intersect(first: list[Interval], second: list[Interval]) -> list[Interval]:
    """Common parts of two sorted lists of intervals."""
    common = []
    for one in first:
        for two in second:
            start_us, end_us = max(one.from_us, two.from_us), min(one.to_us, two.to_us)
            if start_us < end_us:
                common.append(Interval(start_us, end_us))
    return common

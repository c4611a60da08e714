"""Safe-interval path planning (SIPP; Phillips and Likhachev 2011) with whole rest-to-rest moves as edges.

A state is (phase, segment, safe interval), reached standing at the earliest possible time; waiting inside the interval
is free. A move departs as early as every window that the body sweeps lies in a safe interval, so following another
machine with a headway comes out by itself. Phases count the visits made; after the last one the route must end in a
refuge that is safe for ever.

Lifts are moves too: a platform has safe intervals for each floor, and a ride is possible within one gap of the others'
uses.

Best first by (end of the last visit, arrival in a refuge, effort), bounds as long as they lie ahead. A move is
queued under a bound from the first segments that it sweeps, and the rest is looked at only when its turn comes (lazy
evaluation of edges; Cohen, Phillips and Likhachev 2014): most never do.
"""

from collections.abc import Mapping
from heapq import heappop, heappush
from typing import NamedTuple

from onboard.contract.codes import LegAction
from onboard.core.site import Segment
from onboard.ways.departures import Departures
from onboard.ways.kinematics import ceil_ms
from onboard.ways.reservations import FOREVER, Interval, Reservations
from onboard.ways.roads import Move, Roads, roads_of
from onboard.ways.site import WaySite
from onboard.ways.stops import Stops


class Visit(NamedTuple):
    """Stand at ``segment`` for ``dwell_us``, beginning not before ``not_before_us`` (bus time)."""

    segment: Segment
    dwell_us: int
    not_before_us: int = 0


class RouteLeg(NamedTuple):
    """One leg ``[begin_us, end_us)``, both whole milliseconds; WORK is a visit's dwell, STAND a wait.

    TRAVEL with equal indices is the hop from the segment before it through a junction onto this track. RIDE is on a
    lift's track between two of the lift's indices, from the platform of one alley to that of another.
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


def free_flow_us(site: WaySite, start: Segment, start_us: int, visits: tuple[Visit, ...]) -> int:
    """When the last visit would end with nobody in the way and every lift at hand: the least of all routes.

    It depends on nothing but site and arguments. FOREVER where a visit is out of reach.
    """
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
    site: WaySite,
    reservations: Reservations,
    owner: int,
    start: Segment,
    start_us: int,
    visits: tuple[Visit, ...],
    refuges: frozenset[Segment],
    max_expansions: int,
    lift_floors: Mapping[int, int] | None = None,
) -> Route | NoRoute:
    """The route with the earliest end of the last visit, from standing at ``start`` at bus time ``start_us``.

    Equal ends go to the earlier arrival in a refuge, then to less time on platforms, less travel, fewer moves and waits
    nearer to where it goes next, among those that come to the same states at the same times. Windows of ``owner``
    itself are no obstacle. Bounded by ``max_expansions``, never by wall time; what is still equal is taken in the order
    of discovery, which is fixed.

    ``lift_floors`` tells where each lift (by its track) stands at ``start_us`` unless somebody uses it then: the lift's
    index of the floor, 1 where it is not named; one on whose platform the route starts is there.
    """
    start_us = ceil_ms(start_us)
    roads = roads_of(site)
    aboard = roads.lift_at(start)
    floors = dict(lift_floors or {}) | (dict((aboard,)) if aboard is not None else {})
    if not roads.knows(start) or free_flow_us(site, start, start_us, visits) >= FOREVER:
        return NoRoute("a visit is out of reach of the start", 0)
    departures = Departures(roads, reservations, owner, start_us, floors)
    interval = departures.standing_at(start, start_us)
    if interval is None:
        return NoRoute(f"the start {start} is reserved by another machine", 0)
    root = _Node(0, start, interval, start_us, None, LegAction.STAND, start_us, (), _Effort(0, 0, 0))
    return _IntervalSearch(roads, departures, visits, refuges).run(root, max_expansions)


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
    effort: "_Effort"


class _Effort(NamedTuple):
    """What breaks ties: time standing or riding on platforms, which others may want, then distance, then moves."""

    aboard_us: int
    travel_mm: int
    moves: int


class _Untried(NamedTuple):
    """A move to a safe interval of its destination, not before ``arrival_us``, with departures to choose from."""

    move: Move
    interval: Interval
    arrival_us: int
    choice: list[Interval]


#: (end of the last visit, arrival in a refuge, effort, minus the last move's beginning, order of discovery).
_Key = tuple[int, int, _Effort, int, int]
#: In a key, of a move that is still to be tried: it comes before all states that are as good.
_UNTRIED = -FOREVER


class _IntervalSearch:
    """One search.

    ``_tails`` holds for each phase (work, floor): whoever arrives at its visit at t ends the last visit at
    max(t + work, floor) with nobody in the way.
    """

    def __init__(
        self,
        roads: Roads,
        departures: Departures,
        visits: tuple[Visit, ...],
        refuges: frozenset[Segment],
    ) -> None:
        self.roads = roads
        self.departures = departures
        self.visits = visits
        self.refuges = refuges
        targets = [frozenset((visit.segment,)) for visit in visits]
        self._stops = [Stops(roads, departures, goals) for goals in (*targets, refuges)]
        self._targets = (*targets, refuges)
        self._way_us: list[dict[Segment, int]] = [{} for _ in self._targets]
        self._tails = _tails(roads, visits)
        self._queue: list[tuple[_Key, _Node, _Untried | None]] = []
        self._pushed = 0
        #: By phase, segment and begin of the interval: later arrivals than this are of no use.
        self._useful_us: list[dict[Segment, dict[int, int]]] = [{} for _ in self._targets]

    def run(self, root: _Node, max_expansions: int) -> Route | NoRoute:
        """Search from ``root``; see ``plan_route``. The queue holds nodes, and nodes with a move still to be tried."""
        self._push(root)
        expansions = 0
        while self._queue:
            _, node, untried = heappop(self._queue)
            if untried is not None:
                self._try(node, untried)
                continue
            if not self._is_useful(node):
                continue
            if self._is_goal(node):
                finish_us = node.visit_ends_us[-1] if node.visit_ends_us else node.time_us
                return Route(tuple(_legs(self.roads, node)), node.visit_ends_us, finish_us, expansions)
            if expansions >= max_expansions:
                return NoRoute("the search's bound of expansions is reached", expansions)
            expansions += 1
            # From now on one has to be earlier; until now it was enough to be as early.
            self._useful_us[node.phase][node.segment][node.interval.from_us] = node.time_us - 1
            self._expand(node)
        return NoRoute("no order of waits and moves leads to the goal and a refuge", expansions)

    def _is_useful(self, node: _Node) -> bool:
        """Whether a state was not reached earlier, nor left before at the same time or earlier.

        A state can come up again earlier after the last visit only: by a route that ends that visit later.
        """
        return node.time_us <= self._useful_us[node.phase].get(node.segment, {}).get(node.interval.from_us, FOREVER)

    def _is_goal(self, node: _Node) -> bool:
        return node.phase == len(self.visits) and node.segment in self.refuges and node.interval.to_us >= FOREVER

    def _expand(self, node: _Node) -> None:
        """Queue the dwell of the next visit, if it is here, and every move under the least time that it takes."""
        if node.phase < len(self.visits) and self.visits[node.phase].segment == node.segment:
            self._push_dwell(node, self.visits[node.phase])
        within = Interval(node.time_us, node.interval.to_us)
        all_useful_us = self._useful_us[node.phase]
        moves = self._stops[node.phase].moves(node.segment, node.time_us)
        for move, choice in self.departures.moves(node.segment, moves, within):
            first_us, last_us = choice[0].from_us + move.duration_us, choice[-1].to_us + move.duration_us
            useful_us = all_useful_us.get(move.destination, {})
            for interval in self.departures.standing(move.destination):
                if interval.from_us >= last_us:
                    break
                arrival_us = max(first_us, interval.from_us)
                if arrival_us < interval.to_us and arrival_us <= useful_us.get(interval.from_us, FOREVER):
                    self._queue_move(node, _Untried(move, interval, arrival_us, choice))

    def _queue_move(self, node: _Node, untried: "_Untried") -> None:
        ends = self._ends_us(node, untried.move.destination, untried.arrival_us)
        if max(ends) < FOREVER:
            self._pushed += 1
            heappush(self._queue, ((*ends, node.effort, _UNTRIED, self._pushed), node, untried))

    def _effort(self, node: _Node, move: Move, arrival_us: int) -> _Effort:
        aboard_us, travel_mm, moves = node.effort
        if self.roads.lift_at(node.segment) is not None:
            aboard_us += arrival_us - node.time_us
            if move.lift_track is None:
                aboard_us -= move.duration_us
        return _Effort(aboard_us, travel_mm + move.distance_mm, moves + 1)

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

    def _try(self, node: _Node, untried: "_Untried") -> None:
        """Queue the earliest arrival of a move in a safe interval of its destination."""
        move, interval = untried.move, untried.interval
        useful_us = self._useful_us[node.phase].get(move.destination, {})
        if untried.arrival_us > useful_us.get(interval.from_us, FOREVER):
            return
        depart_us = self.departures.first(node.segment, move, untried.choice, interval)
        if depart_us is None:
            return
        self._push(
            _Node(
                node.phase,
                move.destination,
                interval,
                depart_us + move.duration_us,
                node,
                LegAction.TRAVEL if move.lift_track is None else LegAction.RIDE,
                depart_us,
                node.visit_ends_us,
                self._effort(node, move, depart_us + move.duration_us),
            )
        )

    def _push(self, node: _Node) -> None:
        ends = self._ends_us(node, node.segment, node.time_us)
        if self._is_useful(node) and max(ends) < FOREVER:
            self._pushed += 1
            useful_us = self._useful_us[node.phase].setdefault(node.segment, {})
            useful_us[node.interval.from_us] = min(node.time_us, useful_us.get(node.interval.from_us, FOREVER))
            heappush(self._queue, ((*ends, node.effort, -node.begin_us, self._pushed), node, None))

    def _ends_us(self, node: _Node, segment: Segment, time_us: int) -> tuple[int, int]:
        """Earliest end of the last visit, and then arrival in a refuge, from standing at ``segment`` at ``time_us``.

        Before the last visit is over the second is the time itself: the same end leads to the same refuge. Without
        visits all ends are equal.
        """
        ways = self._way_us[node.phase]
        way_us = ways.get(segment)
        if way_us is None:
            way_us = ways[segment] = self.roads.nearest_us(segment, self._targets[node.phase])
        if node.phase == len(self.visits):
            return (node.visit_ends_us[-1] if node.visit_ends_us else 0), time_us + way_us
        work_us, floor_us = self._tails[node.phase]
        return max(time_us + way_us + work_us, floor_us), time_us


def _tails(roads: Roads, visits: tuple[Visit, ...]) -> list[tuple[int, int]]:
    """For each phase the constants of ``_IntervalSearch``, from the last visit backwards."""
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


def _legs(roads: Roads, node: _Node) -> list[RouteLeg]:
    """The legs from the start to ``node``, waits made explicit.

    A route that sets off with a hop gets a first leg of no length, so that it tells where the hop begins.
    """
    legs: list[RouteLeg] = []
    while node.parent is not None:
        before = node.parent
        here, there = before.segment, node.segment
        hops = here.track != there.track
        if node.action is LegAction.RIDE:
            legs.append(_ride(roads, node, here))
        else:
            from_index = there.index if hops else here.index
            legs.append(RouteLeg(node.action, there.track, from_index, there.index, node.begin_us, node.time_us))
        if node.begin_us > before.time_us or (hops and before.parent is None):
            legs.append(RouteLeg(LegAction.STAND, here.track, here.index, here.index, before.time_us, node.begin_us))
        node = before
    return legs[::-1]


def _ride(roads: Roads, node: _Node, here: Segment) -> RouteLeg:
    stops = roads.lift_at(here), roads.lift_at(node.segment)
    if stops[0] is None or stops[1] is None:
        raise AssertionError(f"a ride from {here} to {node.segment}, which are no platforms")
    return RouteLeg(LegAction.RIDE, stops[0][0], stops[0][1], stops[1][1], node.begin_us, node.time_us)

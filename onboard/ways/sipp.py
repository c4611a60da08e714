"""Safe-interval path planning (SIPP; Phillips and Likhachev 2011) with whole rest-to-rest moves as edges.

A state is (phase, segment, safe interval), reached standing at the earliest possible time; waiting inside the interval
is free. A move departs as early as every window that the body sweeps lies in a safe interval, so following another
machine with a headway comes out by itself. Phases count the visits made; after the last one the route must end in a
refuge that is safe for ever.

Lifts are moves too: a platform has safe intervals for each floor, and a ride is possible within one gap of the others'
uses.

Best first by (end of the last visit, arrival in a refuge, effort), bounds as long as they lie ahead. A move is looked
at whole only where its bound promises an earlier arrival, or an equal one with less effort, than the best known (lazy
evaluation of edges; Cohen, Phillips and Likhachev 2014); states and edges are kept for the next search.
"""

from collections.abc import Callable, Iterable, Mapping
from heapq import heappop, heappush
from typing import NamedTuple

from onboard.contract.codes import LegAction
from onboard.core.site import Segment
from onboard.ways.edges import edges_of
from onboard.ways.effort import POP_STEPS, Search, at_once
from onboard.ways.kinematics import ceil_ms
from onboard.ways.moves import Ground, Moves
from onboard.ways.reservations import FOREVER, Reservations
from onboard.ways.roads import roads_of
from onboard.ways.site import WaySite
from onboard.ways.states import NO_EDGE, Edge, State

#: A search may pause after each so many states taken off its queue.
PAUSE_POPS = 8


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
    """A plan: its legs, when each visit ends, when the last one ends, and what the search cost: states and queue.

    Without visits ``finish_us`` is when the route ends in a refuge.
    """

    legs: tuple[RouteLeg, ...]
    visit_ends_us: tuple[int, ...]
    finish_us: int
    expansions: int
    pops: int


class NoRoute(NamedTuple):
    """No plan within the bound of expansions, and why."""

    reason: str
    expansions: int
    pops: int = 0


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


def free_flow_ends(
    site: WaySite, start: Segment, start_us: int, visit: Visit, goals: Iterable[Segment]
) -> dict[Segment, int]:
    """What ``free_flow_us`` is for a visit alone, at each of ``goals`` in the stead of its own segment."""
    roads = roads_of(site)
    begun_us, least_us, dwell_us = ceil_ms(start_us), ceil_ms(visit.not_before_us), ceil_ms(visit.dwell_us)
    ways = {goal: roads.shortest_us(start, goal) if roads.knows(goal) else FOREVER for goal in goals}
    return {
        goal: FOREVER if way_us >= FOREVER else max(begun_us + way_us, least_us) + dwell_us
        for goal, way_us in ways.items()
    }


def planning(
    site: WaySite,
    reservations: Reservations,
    owner: int,
    start: Segment,
    start_us: int,
    visits: tuple[Visit, ...],
    refuges: frozenset[Segment],
    max_expansions: int,
    lift_floors: Mapping[int, int] | None = None,
) -> Search[Route | NoRoute]:
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
    edges = edges_of(roads, reservations, owner, start_us, floors)
    return (yield from searching(roads, edges, start, start_us, visits, refuges, max_expansions))


def searching(
    ground: Ground,
    moves: Moves,
    start: Segment,
    start_us: int,
    visits: tuple[Visit, ...],
    refuges: frozenset[Segment],
    max_expansions: int,
    before_us: int = FOREVER,
) -> Search[Route | NoRoute]:
    """As ``planning``, over any ground and moves; ``start_us`` in whole milliseconds.

    A route whose last visit ends at ``before_us`` or later counts for nothing, and is not looked for.
    """
    state = moves.state_at(start, start_us)
    if state is None:
        return NoRoute(f"the start {start} is reserved by another machine", 0)
    root = _Node(0, state, (start_us, 0, 0, 0, -start_us), None, LegAction.STAND, ())
    found = yield from _IntervalSearch(ground, moves, visits, refuges, before_us).run(root, max_expansions)
    yield found.pops % PAUSE_POPS * POP_STEPS
    return found


#: The same at once.
plan_route, find_route = at_once(planning), at_once(searching)


#: How a state is reached, of several the least: arrival; time standing or riding on platforms, which others may want,
#: then distance, then moves; minus the last move's beginning.
_Label = tuple[int, int, int, int, int]


class _Node(NamedTuple):
    """A state reached from ``parent``."""

    phase: int
    state: State
    label: _Label
    parent: "_Node | None"
    action: LegAction
    visit_ends_us: tuple[int, ...]

    @property
    def time_us(self) -> int:
        """When it is reached."""
        return self.label[0]

    @property
    def begin_us(self) -> int:
        """When the leg that leads here began."""
        return -self.label[4]


#: End of the last visit, arrival in a refuge, label without its arrival, order of discovery; the state's key, node. The
#: order is that of the states that it comes from, then runs before hops, then that of positions: nothing kept changes
#: it. One tuple: thousands are made in a search.
_Entry = tuple[int, int, int, int, int, int, int, bool, Segment, int, int, _Node]


class _IntervalSearch:
    """One search.

    ``_tails`` holds for each phase (work, floor): whoever arrives at its visit at t ends the last visit at
    max(t + work, floor) with nobody in the way.
    """

    def __init__(
        self, roads: Ground, edges: Moves, visits: tuple[Visit, ...], refuges: frozenset[Segment], before_us: int
    ) -> None:
        self.roads = roads
        self.edges = edges
        self.visits = visits
        self.refuges = refuges
        self._targets = (*(frozenset((visit.segment,)) for visit in visits), refuges)
        #: By phase, as each is come to first: many searches end before they look for a refuge.
        self._ways_us: list[Callable[[Segment], int]] = []
        self._tails = _tails(roads, visits)
        self._queue: list[_Entry] = []
        self.expansions = 0
        self._goal_tracks = [{goal.track for goal in goals} for goals in self._targets]
        #: By phase: the best label of each state by its key.
        self._best: list[dict[int, _Label]] = [{} for _ in self._targets]
        #: By phase: intervals of its visit that are not reached yet. When there are none the phase is over.
        self._open = [{state for state in edges.states(visit.segment) if _fits(state, visit)} for visit in visits]
        #: End of the last visit and arrival in a refuge of the best route found; before there is one, of the worst that
        #: counts.
        self._found = before_us - 1, FOREVER

    def run(self, root: _Node, max_expansions: int) -> Search[Route | NoRoute]:
        """Search from ``root``; see ``plan_route``. It may pause after each ``PAUSE_POPS``."""
        self._push(root, self._key(root))
        pops, queue = 0, self._queue
        while queue:
            *_, key, node = heappop(queue)
            pops += 1
            if not pops % PAUSE_POPS:
                yield PAUSE_POPS * POP_STEPS
            phase, state, label, _, _, visit_ends_us = node
            if self._best[phase][key] is not label or self._is_over(phase):
                continue
            if self._is_goal(phase, state):
                finish_us = visit_ends_us[-1] if visit_ends_us else node.time_us
                return Route(tuple(_legs(self.roads, node)), visit_ends_us, finish_us, self.expansions, pops)
            if self.expansions >= max_expansions:
                return NoRoute("the search's bound of expansions is reached", self.expansions, pops)
            self.expansions += 1
            # From now on one has to be earlier; until now it was enough to be as early, with less effort. A state can
            # come up again earlier after the last visit only: by a route that ends that visit later.
            self._best[phase][key] = label[0], -1, 0, 0, 0
            self._expand(node)
        return NoRoute("no order of waits and moves leads to the goal and a refuge", self.expansions, pops)

    def _is_goal(self, phase: int, state: State) -> bool:
        return phase == len(self.visits) and state.segment in self.refuges and state.to_us >= FOREVER

    def _is_over(self, phase: int) -> bool:
        """Whether each interval of a phase's visit has been reached as early as it can be."""
        return phase < len(self.visits) and not self._open[phase]

    def _expand(self, node: _Node) -> None:
        """Queue the dwell of the next visit, if it is here, and every move that leads to its state best."""
        phase, state, time_us = node.phase, node.state, node.time_us
        if phase < len(self.visits) and self.visits[phase].segment == state.segment:
            self._push_dwell(node, self.visits[phase])
        edges = self.edges.edges(state, time_us)
        if state.segment.track in self._goal_tracks[phase]:
            self._push_moves(node, self.edges.to_goals(state, self._targets[phase]))
        self._push_moves(node, edges)

    def _push_moves(self, node: _Node, edges: list[Edge]) -> None:
        """Queue each move's earliest arrival in its state, where none that is as good is known.

        A bound that promises one is looked at, and what it comes to meets its turn in this very loop.
        """
        phase, state, (time_us, aboard_us, travel_mm, moves, _), _, came, visit_ends_us = node
        best, is_aboard = self._best[phase], self.roads.lift_at(state.segment) is not None
        # A lift comes for who rides: nobody drives onto its platform to make room, and off it again.
        is_to_ride = is_aboard and came is LegAction.TRAVEL
        is_last, is_any_over = phase == len(self.visits), False
        for place, (first_us, last_us, until_us, duration_us, number, distance_mm, is_safe) in enumerate(edges):
            depart_us = first_us if first_us > time_us else time_us
            if depart_us >= last_us or until_us <= time_us:
                continue
            if is_to_ride and distance_mm:
                continue
            arrival_us, key = depart_us + duration_us, number if distance_mm else ~number
            known = best.get(key)
            if (known is not None and arrival_us > known[0]) or (is_last and arrival_us > self._found[1]):
                continue
            waited_us = ((depart_us if distance_mm else arrival_us) - time_us) if is_aboard else 0
            label = arrival_us, aboard_us + waited_us, travel_mm + distance_mm, moves + 1, -depart_us
            if known is not None and label >= known:
                continue
            if not is_safe:
                edges += self.edges.looked_at(state, edges[place])
                edges[place] = NO_EDGE
                is_any_over = True
                continue
            leg, there = LegAction.TRAVEL if distance_mm else LegAction.RIDE, self.edges.numbered[number]
            self._push(_Node(phase, there, label, node, leg, visit_ends_us), key)
        if is_any_over:
            edges[:] = [edge for edge in edges if edge is not NO_EDGE]

    def _key(self, node: _Node) -> int:
        """The state's number; its complement on a platform which one may drive off: by a ride, or after a visit."""
        number = node.state.number
        is_driven = node.action is LegAction.TRAVEL
        return number if is_driven or self.roads.lift_at(node.state.segment) is None else ~number

    def _push_dwell(self, node: _Node, visit: Visit) -> None:
        begin_us = max(node.time_us, ceil_ms(visit.not_before_us))
        end_us = begin_us + ceil_ms(visit.dwell_us)
        self._open[node.phase].discard(node.state)
        if end_us <= node.state.to_us:
            label = end_us, *node.label[1:4], -begin_us
            after = _Node(node.phase + 1, node.state, label, node, LegAction.WORK, (*node.visit_ends_us, end_us))
            self._push(after, self._key(after))

    def _push(self, node: _Node, key: int) -> None:
        """Queue a node whose label is better than the best of its state."""
        phase, state, label, before, _, visit_ends_us = node
        segment, best, time_us = state.segment, self._best[phase], label[0]
        known = best.get(key)
        if known is not None and label >= known:
            return
        if phase == len(self._ways_us):
            self._ways_us.append(self.roads.ways_us(self._targets[phase]).to_us)
        way_us = self._ways_us[phase](segment)
        if phase < len(self.visits):
            work_us, floor_us = self._tails[phase]
            # Before the last visit is over the second is the time itself: the same end leads to the same refuge.
            ends_us = max(time_us + way_us + work_us, floor_us), time_us
        else:
            # Without visits all ends are equal.
            ends_us = visit_ends_us[-1] if visit_ends_us else 0, time_us + way_us
        if ends_us <= self._found and max(ends_us) < FOREVER:
            best[key] = label
            if self._is_goal(phase, state):
                self._found = ends_us
            is_hop = before is not None and before.state.segment.track != segment.track
            heappush(self._queue, (*ends_us, *label[1:], self.expansions, is_hop, segment, state.from_us, key, node))


def _fits(state: State, visit: Visit) -> bool:
    return max(state.from_us, ceil_ms(visit.not_before_us)) + ceil_ms(visit.dwell_us) <= state.to_us


def _tails(roads: Ground, visits: tuple[Visit, ...]) -> list[tuple[int, int]]:
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


def _legs(roads: Ground, node: _Node) -> list[RouteLeg]:
    """The legs from the start to ``node``, waits made explicit.

    A route that sets off with a hop gets a first leg of no length, so that it tells where the hop begins.
    """
    legs: list[RouteLeg] = []
    while node.parent is not None:
        before = node.parent
        here, there = before.state.segment, node.state.segment
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


def _ride(roads: Ground, node: _Node, here: Segment) -> RouteLeg:
    stops = roads.lift_at(here), roads.lift_at(node.state.segment)
    if stops[0] is None or stops[1] is None:
        raise AssertionError(f"a ride from {here} to {node.state.segment}, which are no platforms")
    return RouteLeg(LegAction.RIDE, stops[0][0], stops[0][1], stops[1][1], node.begin_us, node.time_us)

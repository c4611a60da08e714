"""The states of a route search and the moves between them: worked out when first asked for, kept while plans last.

A state is a safe interval of a position. An edge is a move to one of the safe intervals of its destination; its first
departure is a bound until somebody asks for it, for most edges are never the best way to where they lead.

Runs in one direction sweep their first segments alike, however far they go: so these are taken one after the other, and
where they leave no departure all longer runs are out of the question too.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping

from onboard.core.site import Segment
from onboard.ways.departures import Departures, Held
from onboard.ways.kinematics import ceil_ms
from onboard.ways.lifts import platform
from onboard.ways.occupancy import Sweep, junction_segments
from onboard.ways.reservations import FOREVER, Reservations
from onboard.ways.roads import Move, Roads
from onboard.ways.stops import paying_until_us

_NOTHING_HELD: dict[int, Held] = {}


class State:
    """A safe interval ``[from_us, to_us)`` for standing at a position."""

    __slots__ = ("edges", "from_us", "segment", "since_us", "to_goals", "to_us")

    def __init__(self, segment: Segment, from_us: int, to_us: int) -> None:
        self.segment = segment
        self.from_us = from_us
        self.to_us = to_us
        #: Edges hold for whoever stands here at ``since_us`` or later; those to goals by the goals' own set.
        self.since_us = FOREVER
        self.edges: list[Edge] = []
        self.to_goals: dict[frozenset[Segment], list[Edge]] = {}


class Edge:
    """A move that leads from one state to another, if it departs during ``[first_us, last_us)``.

    It pays to make it only while one stands here before ``until_us``. Whoever could depart at ``asked_us`` or later
    departs at ``departs_us`` if it can wait until then.
    """

    __slots__ = (
        "asked_us",
        "departs_us",
        "distance_mm",
        "duration_us",
        "first_us",
        "is_ride",
        "last_us",
        "sweeps",
        "there",
        "until_us",
    )

    def __init__(self, there: State, move: Move, first_us: int, last_us: int, until_us: int, sweeps: "_Sweeps") -> None:
        self.there = there
        self.duration_us = move.duration_us
        self.distance_mm = move.distance_mm
        self.is_ride = move.lift_track is not None
        self.first_us = first_us
        self.last_us = last_us
        self.until_us = until_us
        self.sweeps = sweeps
        self.asked_us = FOREVER
        self.departs_us = 0

    def departure_us(self, from_us: int) -> int:
        """The first departure at ``from_us`` (whole milliseconds) or later, within the edge's own; FOREVER for none."""
        if self.asked_us <= from_us <= self.departs_us:
            return self.departs_us
        self.asked_us = from_us
        self.departs_us = self._find(from_us)
        return self.departs_us

    def _find(self, depart_us: int) -> int:
        """Try each sweep in turn, later whenever one meets what is held, until all of them are clear."""
        last_us = self.last_us
        step, held, here, sweeps, others = self.sweeps
        get = held.get
        place = clear = 0
        count = len(sweeps)
        while True:
            while clear < count:
                offset, enter_us, leave_us = sweeps[place]
                windows = get(here + step * offset)
                if windows is not None:
                    begins, ends = windows
                    meets = bisect_right(ends, depart_us + enter_us)
                    if meets < len(ends) and begins[meets] < depart_us + leave_us:
                        depart_us = -((enter_us - ends[meets]) // 1000) * 1000
                        if depart_us >= last_us:
                            return FOREVER
                        clear = 0
                        continue
                clear += 1
                place = place + 1 if place + 1 < count else 0
            before_us = depart_us
            for (begins, ends), enter_us, leave_us in others:
                meets = bisect_right(ends, depart_us + enter_us)
                while meets < len(ends) and begins[meets] < depart_us + leave_us:
                    depart_us = -((enter_us - ends[meets]) // 1000) * 1000
                    if depart_us >= last_us:
                        return FOREVER
                    meets = bisect_right(ends, depart_us + enter_us)
            if depart_us == before_us:
                return depart_us
            clear = 0


#: Direction, what is held on the track by index, the index of the start, the sweeps of the run; and what else has to
#: be free, with when the move enters and leaves it.
_Sweeps = tuple[int, dict[int, Held], int, tuple[Sweep, ...], tuple[tuple[Held, int, int], ...]]


class Edges:
    """States and edges around the reservations of ``departures``."""

    def __init__(self, departures: Departures) -> None:
        self.departures = departures
        self._roads: Roads = departures.roads
        self._states: dict[Segment, list[State]] = {}
        self._until_us: dict[int, dict[int, int]] = {}

    def states(self, segment: Segment) -> list[State]:
        """The safe intervals for standing at a position, in order."""
        found = self._states.get(segment)
        if found is None:
            safe = self.departures.standing(segment)
            found = self._states[segment] = [State(segment, from_us, to_us) for from_us, to_us in safe]
        return found

    def state_at(self, segment: Segment, time_us: int) -> State | None:
        """The state of standing at a segment at a time, or None."""
        for state in self.states(segment):
            if state.from_us <= time_us < state.to_us:
                return state
        return None

    def edges(self, state: State, from_us: int) -> list[Edge]:
        """Moves from a state to where stopping may pay, for departures from ``from_us`` on, in the roads' order."""
        if from_us < state.since_us:
            state.since_us = from_us
            state.to_goals.clear()
            until_us = self._paying_until(state.segment.track)
            state.edges = [*self._runs(state, from_us, until_us), *self._hops(state, from_us)]
        return state.edges

    def to_goals(self, state: State, goals: frozenset[Segment]) -> list[Edge]:
        """Runs to those of ``goals`` on the same track at which stopping does not always pay; after ``edges``."""
        found = state.to_goals.get(goals)
        if found is None:
            track = state.segment.track
            until_us = self._paying_until(track)
            on_track = {
                one.index: FOREVER for one in goals if one.track == track and until_us.get(one.index, FOREVER) < FOREVER
            }
            found = list(self._runs(state, state.since_us, on_track)) if on_track else []
            if len(state.to_goals) >= _MAX_GOAL_SETS:
                state.to_goals.clear()
            state.to_goals[goals] = found
        return found

    def _paying_until(self, track: int) -> dict[int, int]:
        found = self._until_us.get(track)
        if found is None:
            found = self._until_us[track] = paying_until_us(self.departures, track)
        return found

    def _runs(self, state: State, from_us: int, until_us: dict[int, int]) -> Iterator[Edge]:
        """Runs along the track to indices of ``until_us`` that is later than ``from_us``, by growing index."""
        down = list(self._runs_towards(state, from_us, -1, until_us))
        yield from reversed(down)
        yield from self._runs_towards(state, from_us, 1, until_us)

    def _runs_towards(self, state: State, from_us: int, step: int, until_us: dict[int, int]) -> Iterator[Edge]:
        roads, here = self._roads, state.segment
        track, index = here.track, here.index
        longest, held = roads.longest(track), self.departures.held_on(track)
        depart_us, known = from_us, 0
        for move in roads.runs(here, step):
            there = move.destination.index
            if until_us.get(there, 0) <= from_us:
                continue
            alike = roads.alike(track, abs(there - index))
            while known < alike:
                offset, enter_us, leave_us = longest[known]
                windows = held.get(index + step * offset)
                known += 1
                if windows is not None:
                    begins, ends = windows
                    meets = bisect_right(ends, depart_us + enter_us)
                    if meets < len(ends) and begins[meets] < depart_us + leave_us:
                        depart_us = -((enter_us - ends[meets]) // 1000) * 1000
                        known = 0
                        if depart_us >= state.to_us:
                            return
            sweeps: _Sweeps | None = None
            for one in self.states(move.destination):
                first_us, last_us = (
                    max(depart_us, ceil_ms(one.from_us - move.duration_us)),
                    one.to_us - move.duration_us,
                )
                if first_us >= state.to_us:
                    break
                if first_us < last_us:
                    if sweeps is None:
                        sweeps = self._swept(here, move, step, held)
                    yield Edge(one, move, first_us, min(last_us, state.to_us), until_us[there], sweeps)

    def _swept(self, here: Segment, move: Move, step: int, held: dict[int, Held]) -> _Sweeps:
        """What a run sweeps; from or to a platform it crosses the lift's sill while the platform is there."""
        there = move.destination
        sweeps = self._roads.sweeps(here.track, abs(there.index - here.index))
        reach = -sweeps[0].offset
        sills = tuple(
            (self.departures.held(position), sweep.enter_us, sweep.leave_us)
            for position, sweep in ((here, sweeps[reach]), (there, sweeps[-1 - reach]))
            if self._roads.lift_at(position) is not None
        )
        # The last ones first: what all runs share was free at the edge's first departure.
        return step, held, here.index, sweeps[::-1], sills

    def _hops(self, state: State, from_us: int) -> Iterator[Edge]:
        """Hops to other tracks and rides on a lift."""
        for move in self._roads.hops(state.segment):
            if move.lift_track is not None:
                taken = [platform(move.lift_track)]
            else:
                taken = junction_segments(self._roads.site, state.segment, move.destination)
            free = tuple((self.departures.held(segment), 0, move.duration_us) for segment in taken)
            for one in self.states(move.destination):
                first_us, last_us = max(from_us, ceil_ms(one.from_us - move.duration_us)), one.to_us - move.duration_us
                if first_us >= state.to_us:
                    break
                if first_us < last_us:
                    yield Edge(one, move, first_us, min(last_us, state.to_us), FOREVER, (1, _NOTHING_HELD, 0, (), free))


#: Sets of goals for which a state keeps its edges.
_MAX_GOAL_SETS = 4


def edges_of(
    roads: Roads, reservations: Reservations, owner: int, start_us: int, lift_floors: Mapping[int, int]
) -> Edges:
    """The states and edges of what all but ``owner`` hold from ``start_us`` on, as worked out before if they still hold."""
    key = owner, start_us, tuple(sorted(lift_floors.items()))
    found = reservations.kept.get(key)
    if not isinstance(found, Edges):
        found = Edges(Departures(roads, reservations, owner, start_us, lift_floors))
        while len(reservations.kept) >= _MAX_KEPT:
            del reservations.kept[next(iter(reservations.kept))]
        reservations.kept[key] = found
    return found


#: Searches from different times, or of different machines, whose edges are kept.
_MAX_KEPT = 4

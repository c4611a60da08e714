"""The states of a route search and the moves between them: worked out when first asked for, kept while plans last.

A state is a safe interval of a position. An edge is a move to one of the safe intervals of its destination; its first
departure is a bound until somebody asks for it, for most edges are never the best way to where they lead.

Runs in one direction sweep their first segments alike, however far they go: so these are taken one after the other, and
where they leave no departure all longer runs are out of the question too. They sweep their last ones alike as well,
wherever they come from: when one may arrive is worked out once for all of them (``arrivals``).
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping

from onboard.core.site import Segment
from onboard.ways.arrivals import Arrivals
from onboard.ways.departures import Departures, Held
from onboard.ways.kinematics import ceil_ms
from onboard.ways.lifts import platform
from onboard.ways.occupancy import Sweep, junction_segments
from onboard.ways.reservations import FOREVER, Interval, Reservations
from onboard.ways.roads import Roads
from onboard.ways.stops import paying_until_us

_MS = 1_000
#: Sets of goals for which a state keeps its edges.
_MAX_GOAL_SETS = 4
#: Searches from different times, or of different machines, whose edges are kept.
_MAX_KEPT = 4


class State:
    """A safe interval ``[from_us, to_us)`` for standing at a position; its number is its place among all states."""

    __slots__ = ("edges", "from_us", "number", "segment", "since_us", "to_goals", "to_us")

    def __init__(self, number: int, segment: Segment, from_us: int, to_us: int) -> None:
        self.number = number
        self.segment = segment
        self.from_us = from_us
        self.to_us = to_us
        #: Edges hold for whoever stands here at ``since_us`` or later; those to goals by the goals' own set.
        self.since_us = FOREVER
        self.edges: list[Edge] = []
        self.to_goals: dict[frozenset[Segment], list[Edge]] = {}


def number_on(numbered: list[State], segment: Segment, safe: Iterable[Interval]) -> list[State]:
    """The states of a position's safe intervals, in order; they join those that are ``numbered`` already."""
    found = [State(number, segment, *interval) for number, interval in enumerate(safe, start=len(numbered))]
    numbered += found
    return found


#: A move that leads from one state to another if it departs during ``[first, last)``: first, last, until, duration, the
#: number of the state that it leads to, what the carrier drives in mm (nothing on a lift), is safe. It pays to make it
#: only while one stands here before ``until``. Departures are bounds, some may be safe at most, unless all are. A plain
#: tuple of integers: thousands are kept, and what refers to nothing else the collector of garbage leaves alone.
Edge = tuple[int, int, int, int, int, int, bool]
#: What is left of a bound that was looked at.
NO_EDGE: Edge = (0, 0, 0, 0, 0, 0, True)

#: An index of a track and until when stopping there may pay.
_Paying = tuple[int, int]
#: Departures between which none is safe, both of them excluded.
_Forbidden = tuple[int, int]


def _forbid(found: list[_Forbidden], windows: Held, times: tuple[int, int], edge: Edge) -> None:
    """Add what others forbid of an edge's departures by holding a segment ``times`` after them: enter, leave."""
    (begins, ends), (enter_us, leave_us) = windows, times
    place, count = bisect_right(ends, edge[0] + enter_us), len(ends)
    latest_us = edge[1] + leave_us
    while place < count and (begin_us := begins[place]) < latest_us:
        found.append((begin_us - leave_us, ends[place] - enter_us))
        place += 1


class _Shared:
    """What runs in one direction share: the ``known`` first sweeps, and the departures ``[from, to)`` that these leave.

    The first departures are clear of them until ``clear_us``.
    """

    __slots__ = ("_held", "_index", "_longest", "_step", "clear_us", "from_us", "known", "to_us")

    def __init__(
        self, longest: tuple[Sweep, ...], held: dict[int, Held], index: int, step: int, from_us: int, to_us: int
    ) -> None:
        self._longest, self._held, self._index, self._step = longest, held, index, step
        self.from_us, self.to_us = from_us, to_us
        self.clear_us, self.known = FOREVER, 0

    def take(self, count: int) -> None:
        """Take the first ``count`` sweeps into account."""
        from_us, to_us, clear_us, known = self.from_us, self.to_us, self.clear_us, self.known
        held, longest, index, step = self._held, self._longest, self._index, self._step
        while known < count and from_us < to_us:
            offset, enter_us, leave_us = longest[known]
            known += 1
            windows = held.get(index + step * offset)
            if windows is None:
                continue
            begins, ends = windows
            meets, windows_count = bisect_right(ends, from_us + enter_us), len(ends)
            if meets == windows_count:
                continue
            met_us = begins[meets] - leave_us
            if met_us < from_us:
                from_us = -((enter_us - ends[meets]) // _MS) * _MS
                known, clear_us = 0, FOREVER
            elif met_us < to_us - 1:
                clear_us = min(clear_us, met_us)
                # The last safe departure before the end is found as the first is, from the other side.
                meets = bisect_right(ends, to_us - 1 + enter_us, meets)
                while meets < windows_count and begins[meets] - leave_us < to_us - 1:
                    to_us = begins[meets] - leave_us + 1
                    meets = bisect_right(ends, to_us - 1 + enter_us)
        self.from_us, self.to_us, self.clear_us, self.known = from_us, to_us, clear_us, known


def _cut(edge: Edge, clear_us: int) -> list[Edge]:
    """A bound of which all departures until ``clear_us`` are safe: these, if any, and the bound behind them."""
    first_us, last_us, until_us, duration_us, number, distance_mm, _ = edge
    behind_us = max(first_us, ceil_ms(clear_us + 1))
    found = [(first_us, min(behind_us, last_us), until_us, duration_us, number, distance_mm, True)]
    bound = (behind_us, last_us, until_us, duration_us, number, distance_mm, False)
    return found[: behind_us > first_us] + [bound][: behind_us < last_us]


class Edges:
    """States and edges around the reservations of ``departures``."""

    def __init__(self, departures: Departures) -> None:
        self.departures = departures
        self._roads: Roads = departures.roads
        #: All states that were asked for, by their numbers.
        self.numbered: list[State] = []
        self._states: dict[Segment, list[State]] = {}
        self._paying: dict[int, list[_Paying]] = {}
        self._arrivals = Arrivals(departures, self.states)

    def states(self, segment: Segment) -> list[State]:
        """The safe intervals for standing at a position, in order."""
        found = self._states.get(segment)
        if found is None:
            found = self._states[segment] = number_on(self.numbered, segment, self.departures.standing(segment))
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
            state.edges = self._runs(state, from_us, self._paying_on(state.segment.track))
            if self._roads.hops(state.segment):
                state.edges += self._hops(state, from_us)
        return state.edges

    def to_goals(self, state: State, goals: frozenset[Segment]) -> list[Edge]:
        """Runs to those of ``goals`` on the same track at which stopping does not always pay, the earliest first.

        For departures from when ``edges`` was asked for on.
        """
        found = state.to_goals.get(goals)
        if found is None:
            track = state.segment.track
            always = {index for index, until_us in self._paying_on(track) if until_us >= FOREVER}
            on_track = sorted(
                (one.index, FOREVER)
                for one in goals
                if one.track == track and one.index not in always and self._roads.knows(one)
            )
            if len(state.to_goals) >= _MAX_GOAL_SETS:
                state.to_goals.clear()
            found = state.to_goals[goals] = self._runs(state, state.since_us, on_track) if on_track else []
            found.sort(key=_arrival_us)
        return found

    def _paying_on(self, track: int) -> list[_Paying]:
        found = self._paying.get(track)
        if found is None:
            found = self._paying[track] = paying_until_us(self.departures, track)
        return found

    def _runs(self, state: State, from_us: int, paying: list[_Paying]) -> list[Edge]:
        """Runs along the track to where stopping pays later than ``from_us``, by growing index."""
        split = bisect_left(paying, (state.segment.index, 0))
        down = self._runs_towards(state, from_us, -1, paying[:split][::-1])
        return down[::-1] + self._runs_towards(state, from_us, 1, paying[split:])

    def _runs_towards(self, state: State, from_us: int, step: int, paying: list[_Paying]) -> list[Edge]:
        """Runs in one direction, the nearest first."""
        found: list[Edge] = []
        if not paying:
            return found
        here = state.segment
        held, arrivals, runs = self.departures.held_on(here.track), self._arrivals, self._roads.runs(here)
        shared = _Shared(self._roads.longest(here.track), held, here.index, step, from_us, state.to_us)
        leaves_by_us = self._leaves_by_us(state)
        for index, pays_us in paying:
            if pays_us <= from_us or (run := runs[index]) is None:
                continue
            there, duration_us, distance_mm, alike, tail, leave_us = run
            if held and shared.known < alike:
                shared.take(alike)
            depart_us, to_us = shared.from_us, min(shared.to_us, leaves_by_us - leave_us + 1)
            if depart_us >= shared.to_us:
                break
            windows, lates_us = arrivals[there, tail]
            for place in range(bisect_right(lates_us, depart_us + duration_us), len(lates_us)):
                arrive_us, late_us, number = windows[place]
                first_us = max(depart_us, -((duration_us - arrive_us) // _MS) * _MS)
                if first_us >= to_us:
                    break
                last_us, clear_us = min(late_us - duration_us, to_us), shared.clear_us
                if first_us < last_us <= clear_us:
                    found.append((first_us, last_us, pays_us, duration_us, number, distance_mm, True))
                elif first_us < last_us:
                    found += _cut((first_us, last_us, pays_us, duration_us, number, distance_mm, False), clear_us)
        return found

    def _leaves_by_us(self, state: State) -> int:
        """When a platform is away after a state there: whoever leaves it has left it then. FOREVER elsewhere."""
        if self._roads.lift_at(state.segment) is None:
            return FOREVER
        begins, ends = self.departures.held(state.segment)
        away = bisect_right(ends, state.from_us)
        return begins[away] if away < len(begins) else FOREVER

    def _hops(self, state: State, from_us: int) -> list[Edge]:
        """Hops to other tracks and rides on a lift."""
        return [
            (first_us, last_us, FOREVER, duration_us, one.number, distance_mm, False)
            for there, duration_us, distance_mm, _ in self._roads.hops(state.segment)
            for one in self.states(there)
            if (first_us := max(from_us, ceil_ms(one.from_us - duration_us)))
            < (last_us := min(one.to_us - duration_us, state.to_us))
        ]

    def looked_at(self, here: State, edge: Edge) -> list[Edge]:
        """What a bound comes to: all its departures that are safe."""
        first_us, last_us, until_us, duration_us, number, distance_mm, _ = edge
        there = self.numbered[number].segment
        if here.segment.track == there.track:
            forbidden = self._run_forbidden(here.segment, there, edge)
        else:
            forbidden = self._hop_forbidden(here.segment, there, edge)
        found: list[Edge] = []
        for clear_us, next_us in sorted(forbidden):
            if clear_us >= last_us or first_us >= last_us:
                break
            if next_us > first_us:
                if clear_us >= first_us:
                    found.append((first_us, clear_us + 1, until_us, duration_us, number, distance_mm, True))
                first_us = ceil_ms(next_us)
        if first_us < last_us:
            found.append((first_us, last_us, until_us, duration_us, number, distance_mm, True))
        return found

    def _hop_forbidden(self, here: Segment, there: Segment, edge: Edge) -> list[_Forbidden]:
        duration_us, distance_mm = edge[3], edge[5]
        lift = None if distance_mm else self._roads.lift_at(here)
        taken = junction_segments(self._roads.site, here, there) if lift is None else [platform(lift[0])]
        found: list[_Forbidden] = []
        for segment in taken:
            _forbid(found, self.departures.held(segment), (0, duration_us), edge)
        return found

    def _run_forbidden(self, here: Segment, there: Segment, edge: Edge) -> list[_Forbidden]:
        """What others hold of what a run sweeps; from or to a platform it crosses the sill while that is there."""
        roads, index, held = self._roads, here.index, self.departures.held_on(here.track)
        step = 1 if there.index > index else -1
        sweeps, _ = roads.swept(here.track, abs(there.index - index))
        found: list[_Forbidden] = []
        for offset, enter_us, leave_us in sweeps:
            windows = held.get(index + step * offset)
            if windows is not None:
                _forbid(found, windows, (enter_us, leave_us), edge)
        reach = -sweeps[0].offset
        for position, sweep in ((here, sweeps[reach]), (there, sweeps[-1 - reach])):
            if roads.lift_at(position) is not None:
                _forbid(found, self.departures.held(position), (sweep.enter_us, sweep.leave_us), edge)
        return found


def _arrival_us(edge: Edge) -> int:
    return edge[0] + edge[3]


def edges_of(
    roads: Roads, reservations: Reservations, owner: int, start_us: int, lift_floors: Mapping[int, int]
) -> Edges:
    """The states and edges of what all but ``owner`` hold from ``start_us`` on, kept while they do."""
    key = owner, (start_us, tuple(sorted(lift_floors.items())))
    found = reservations.kept.get(key)
    if not isinstance(found, Edges):
        found = Edges(Departures(roads, reservations, owner, start_us, lift_floors))
        while len(reservations.kept) >= _MAX_KEPT:
            del reservations.kept[next(iter(reservations.kept))]
        reservations.kept[key] = found
    return found

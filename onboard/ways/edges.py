"""The states of a route search and the moves between them: worked out when first asked for, kept while plans last.

A state is a safe interval of a position. An edge is a move to one of the safe intervals of its destination; its first
departure is a bound until somebody asks for it, for most edges are never the best way to where they lead.

Runs in one direction sweep their first segments alike, however far they go: so these are taken one after the other, and
where they leave no departure all longer runs are out of the question too. They sweep their last ones alike as well,
wherever they come from: when one may arrive is worked out once for all of them (``arrivals``).
"""

from bisect import bisect_right
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

#: Departures between which none is safe, both of them excluded.
_Forbidden = tuple[int, int]


def _forbidden(windows: Held, enter_us: int, leave_us: int) -> list[_Forbidden]:
    """What others forbid by holding a segment that the move enters and leaves so long after its departure."""
    return [(begin_us - leave_us, end_us - enter_us) for begin_us, end_us in zip(*windows, strict=True)]


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
        from_us, to_us, known, held = self.from_us, self.to_us, self.known, self._held
        while known < count and from_us < to_us:
            offset, enter_us, leave_us = self._longest[known]
            known += 1
            windows = held.get(self._index + self._step * offset)
            if windows is None:
                continue
            begins, ends = windows
            meets = bisect_right(ends, from_us + enter_us)
            if meets == len(ends):
                continue
            clear_us = begins[meets] - leave_us
            if clear_us < from_us:
                from_us = -((enter_us - ends[meets]) // _MS) * _MS
                known, self.clear_us = 0, FOREVER
            elif clear_us < to_us - 1:
                self.clear_us = min(self.clear_us, clear_us)
                to_us = _last_safe(windows, enter_us, leave_us, to_us)
        self.from_us, self.to_us, self.known = from_us, to_us, known


def _last_safe(windows: Held, enter_us: int, leave_us: int, to_us: int) -> int:
    """The end of departures before ``to``, of which the last is safe: found as the first is, from the other side."""
    begins, ends = windows
    meets = bisect_right(ends, to_us - 1 + enter_us)
    while meets < len(ends) and begins[meets] - leave_us < to_us - 1:
        to_us = begins[meets] - leave_us + 1
        meets = bisect_right(ends, to_us - 1 + enter_us)
    return to_us


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
        self._until_us: dict[int, dict[int, int]] = {}
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
            state.edges = self._runs(state, from_us, self._paying_until(state.segment.track))
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
            until_us = self._paying_until(track)
            on_track = {
                one.index: FOREVER for one in goals if one.track == track and until_us.get(one.index, FOREVER) < FOREVER
            }
            if len(state.to_goals) >= _MAX_GOAL_SETS:
                state.to_goals.clear()
            found = state.to_goals[goals] = self._runs(state, state.since_us, on_track) if on_track else []
            found.sort(key=_arrival_us)
        return found

    def _paying_until(self, track: int) -> dict[int, int]:
        found = self._until_us.get(track)
        if found is None:
            found = self._until_us[track] = paying_until_us(self.departures, track)
        return found

    def _runs(self, state: State, from_us: int, until_us: dict[int, int]) -> list[Edge]:
        """Runs along the track to indices of ``until_us`` that is later than ``from_us``, by growing index."""
        return self._runs_towards(state, from_us, -1, until_us)[::-1] + self._runs_towards(state, from_us, 1, until_us)

    def _runs_towards(self, state: State, from_us: int, step: int, until_us: dict[int, int]) -> list[Edge]:
        """Runs in one direction, the nearest first."""
        found: list[Edge] = []
        here = state.segment
        held, arrivals = self.departures.held_on(here.track), self._arrivals
        shared = _Shared(self._roads.longest(here.track), held, here.index, step, from_us, state.to_us)
        leaves_by_us = self._leaves_by_us(state)
        for there, duration_us, distance_mm, alike, tail, leave_us in self._roads.runs(here, step):
            pays_us = until_us.get(there.index, 0)
            if pays_us <= from_us:
                continue
            if shared.known < alike:
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
            forbidden = self._run_forbidden(here.segment, there)
        else:
            forbidden = self._hop_forbidden(here.segment, there, duration_us, distance_mm)
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

    def _hop_forbidden(self, here: Segment, there: Segment, duration_us: int, distance_mm: int) -> list[_Forbidden]:
        lift = None if distance_mm else self._roads.lift_at(here)
        taken = junction_segments(self._roads.site, here, there) if lift is None else [platform(lift[0])]
        return [one for segment in taken for one in _forbidden(self.departures.held(segment), 0, duration_us)]

    def _run_forbidden(self, here: Segment, there: Segment) -> list[_Forbidden]:
        """What others hold of what a run sweeps; from or to a platform it crosses the sill while that is there."""
        roads, index, held = self._roads, here.index, self.departures.held_on(here.track)
        step = 1 if there.index > index else -1
        sweeps, _ = roads.swept(here.track, abs(there.index - index))
        found: list[_Forbidden] = []
        for offset, enter_us, leave_us in sweeps:
            windows = held.get(index + step * offset)
            if windows is not None:
                found += _forbidden(windows, enter_us, leave_us)
        reach = -sweeps[0].offset
        for position, sweep in ((here, sweeps[reach]), (there, sweeps[-1 - reach])):
            if roads.lift_at(position) is not None:
                found += _forbidden(self.departures.held(position), sweep.enter_us, sweep.leave_us)
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

"""The states of a route search and the moves between them: worked out when first asked for, kept while plans last.

A state is a safe interval of a position. An edge is a move to one of the safe intervals of its destination; its first
departure is a bound until somebody asks for it, for most edges are never the best way to where they lead.

Runs in one direction sweep their first segments alike, however far they go: so these are taken one after the other, and
where they leave no departure all longer runs are out of the question too. They sweep their last ones alike as well,
wherever they come from: when one may arrive is worked out once for all of them (``arrivals``).
"""

from bisect import bisect_left, bisect_right
from collections.abc import Generator, Mapping

from onboard.core.site import Segment
from onboard.ways.arrivals import TAIL_SHIFT, Arrivals
from onboard.ways.departures import Departures, Held
from onboard.ways.kinematics import ceil_ms
from onboard.ways.lifts import platform
from onboard.ways.occupancy import Sweep, junction_segments
from onboard.ways.reservations import FOREVER, Reservations
from onboard.ways.roads import Roads
from onboard.ways.states import Edge, State, States
from onboard.ways.stops import paying_until_us

_MS = 1_000
#: Sets of goals for which a state keeps its edges.
_MAX_GOAL_SETS = 4
#: Searches from different times, or of different machines, whose edges are kept.
_MAX_KEPT = 4

#: An index of a track and until when stopping there may pay.
_Paying = tuple[int, int]
#: Departures ``[from, to)``; the first of them are clear of what others hold until the third.
_Left = tuple[int, int, int]
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


def _shared(
    longest: tuple[Sweep, ...], held: dict[int, Held], index: int, step: int, from_us: int, to_us: int
) -> Generator[_Left, int, None]:
    """What runs in one direction share: told how many of their first sweeps, it tells the departures that these leave.

    The last one told is the greatest: runs come the nearest first.
    """
    clear_us, known, count = FOREVER, 0, 0
    while True:
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
        count = yield from_us, to_us, clear_us


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
        self._states = States(departures)
        #: All states that were asked for, by their numbers.
        self.numbered = self._states.numbered
        self._paying: dict[int, list[_Paying]] = {}
        self._arrivals: dict[int, Arrivals] = {}

    def states(self, segment: Segment) -> list[State]:
        """The safe intervals for standing at a position, in order."""
        return self._states[segment]

    def state_at(self, segment: Segment, time_us: int) -> State | None:
        """The state of standing at a segment at a time, or None."""
        for state in self.states(segment):
            if state.from_us <= time_us < state.to_us:
                return state
        return None

    def edges(self, state: State, from_us: int) -> list[Edge]:
        """Moves from a state to where stopping may pay, for departures from ``from_us`` on, in the roads' order."""
        found = state.edges
        if found is None or from_us < state.since_us:
            state.since_us, state.to_goals = from_us, None
            found = state.edges = self._runs(state, from_us, self._paying_on(state.segment.track))
            if self._roads.hops(state.segment):
                found += self._hops(state, from_us)
        return found

    def to_goals(self, state: State, goals: frozenset[Segment]) -> list[Edge]:
        """Runs to those of ``goals`` on the same track at which stopping does not always pay, the earliest first.

        For departures from when ``edges`` was asked for on.
        """
        kept = state.to_goals
        if kept is None:
            kept = state.to_goals = {}
        found = kept.get(goals)
        if found is None:
            track = state.segment.track
            always = {index for index, until_us in self._paying_on(track) if until_us >= FOREVER}
            on_track = sorted(
                (one.index, FOREVER)
                for one in goals
                if one.track == track and one.index not in always and self._roads.knows(one)
            )
            if len(kept) >= _MAX_GOAL_SETS:
                kept.clear()
            found = kept[goals] = self._runs(state, state.since_us, on_track) if on_track else []
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
        track, from_index = here.track, here.index
        held, runs = self.departures.held_on(track), self._roads.runs(track)
        arrivals = self._arrivals_on(track)
        shared = _shared(self._roads.longest(track), held, from_index, step, from_us, state.to_us)
        depart_us, end_us, clear_us = next(shared)
        known, leaves_by_us = 0 if held else FOREVER, self._leaves_by_us(state)
        for index, pays_us in paying:
            if pays_us <= from_us or (run := runs[index - from_index]) is None:
                continue
            duration_us, distance_mm, alike, tail, leave_us = run
            if known < alike:
                depart_us, end_us, clear_us = shared.send(alike)
                known = alike
            if depart_us >= end_us:
                break
            to_us = end_us if leaves_by_us >= FOREVER else min(end_us, leaves_by_us - leave_us + 1)
            firsts_us, lates_us, numbers = arrivals[index | tail << TAIL_SHIFT]
            for place in range(bisect_right(lates_us, depart_us + duration_us), len(lates_us)):
                first_us = at_us if (at_us := firsts_us[place] - duration_us) > depart_us else depart_us
                if first_us >= to_us:
                    break
                last_us = by_us if (by_us := lates_us[place] - duration_us) < to_us else to_us
                number = numbers[place]
                if last_us <= clear_us:
                    found.append((first_us, last_us, pays_us, duration_us, number, distance_mm, True))
                else:
                    found += _cut((first_us, last_us, pays_us, duration_us, number, distance_mm, False), clear_us)
        return found

    def _arrivals_on(self, track: int) -> Arrivals:
        found = self._arrivals.get(track)
        if found is None:
            found = self._arrivals[track] = Arrivals(self.departures, self._states, track)
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
        found: list[Edge] = []
        states, until_us = self._states, state.to_us
        for there, duration_us, distance_mm, _ in self._roads.hops(state.segment):
            for one in states[there]:
                last_us = min(one.to_us - duration_us, until_us)
                if last_us <= from_us:
                    continue
                first_us = max(from_us, ceil_ms(one.from_us - duration_us))
                if first_us < last_us:
                    found.append((first_us, last_us, FOREVER, duration_us, one.number, distance_mm, False))
        return found

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

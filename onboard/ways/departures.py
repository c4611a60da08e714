"""When moves can depart around everybody's reservations: what one route search asks, segments looked up once.

A window that the body sweeps ``[enter, leave)`` after the departure and a reservation ``[from, to)`` of the same
segment forbid the departures between ``from - leave`` and ``to - enter``, both excluded. What no pair of them forbids
is a safe departure. Runs in one direction sweep their first segments alike, however far they go: so these are taken
one after the other, and where they leave no departure all longer runs are out of the question too.

A platform has safe intervals for each floor by itself: when the lift can be there. The platform as such is one resource
more, free in the gaps between the others' uses: for the rides.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping

from onboard.core.site import Segment
from onboard.ways.kinematics import ceil_ms
from onboard.ways.lift_uses import HOME_INDEX, Gap, floor_intervals, lift_gaps
from onboard.ways.lifts import PLATFORM_INDEX, platform
from onboard.ways.occupancy import junction_segments, leg_sweeps
from onboard.ways.reservations import FOREVER, Interval, Reservations
from onboard.ways.roads import Move, Roads

#: End of a reservation without end: no window that is swept, however late, comes after it.
_ALL_TIME = 2 * FOREVER


class Departures:
    """Safe intervals for standing and for departing from ``start_us`` on; windows of ``owner`` are no obstacle."""

    def __init__(
        self, roads: Roads, reservations: Reservations, owner: int, start_us: int, lift_floors: Mapping[int, int]
    ) -> None:
        self._roads = roads
        self._lift_floors = lift_floors
        self._gaps_of: dict[int, list[Gap]] = {}
        self._reservations = reservations
        self._owner = owner
        self._start_us = start_us
        self._free: dict[Segment, list[Interval]] = {}
        self._held: dict[Segment, list[Interval]] = {}
        self._standing: dict[Segment, list[Interval]] = {}
        self._tracks: dict[int, dict[int, list[Interval]]] = {}

    def standing(self, segment: Segment) -> list[Interval]:
        """When a body may stand at a segment: all that it touches there must be free."""
        found = self._standing.get(segment)
        if found is None:
            touched = self._roads.touched(segment)
            found = self._free_intervals(touched[0])
            for other in touched[1:]:
                found = _without(found, self._held_windows(other), 0, 1)
            self._standing[segment] = found
        return found

    def standing_at(self, segment: Segment, time_us: int) -> Interval | None:
        """The safe interval for standing at a segment that holds ``time_us``, or None."""
        intervals = self.standing(segment)
        place = bisect_right(intervals, time_us, key=_from_us) - 1
        return intervals[place] if place >= 0 and time_us < intervals[place].to_us else None

    def held_until_us(self, segment: Segment) -> int:
        """When anybody else holds a segment, or a platform is away, for the last time; 0 where never."""
        held = self._held_windows(segment)
        return held[-1].to_us if held else 0

    def moves(self, here: Segment, moves: Iterable[Move], within: Interval) -> Iterator[tuple[Move, list[Interval]]]:
        """Each of ``moves`` that may be possible from standing at ``here`` during ``within``, with departures for it.

        Of runs only what they sweep alike is taken into account yet; ``first`` settles the rest.
        """
        begun: dict[int, list[list[Interval]]] = {1: [[within]], -1: [[within]]}
        longest, held = self._roads.longest(here.track), self._held_on(here.track)
        track, index = here.track, here.index
        for move in moves:
            there = move.destination
            if track != there.track:
                yield move, [within]
                continue
            step = 1 if there.index > index else -1
            alike = self._roads.alike(track, abs(there.index - index))
            left = begun[step]
            while len(left) <= alike and left[-1]:
                offset, enter_us, leave_us = longest[len(left) - 1]
                windows = held.get(index + step * offset)
                left.append(_without(left[-1], windows, enter_us, leave_us) if windows else left[-1])
            safe = left[alike] if alike < len(left) else left[-1]
            if safe:
                yield move, safe

    def first(self, here: Segment, move: Move, choice: list[Interval], arrival: Interval) -> int | None:
        """The first departure of those from ``moves`` that is safe all the way; a whole millisecond, or None.

        ``arrival`` is the interval for standing at the destination in which it has to arrive.
        """
        there, duration_us = move.destination, move.duration_us
        safe = _within(choice, arrival.from_us - duration_us, arrival.to_us - duration_us)
        if move.lift_track is not None:
            safe = _without(safe, self._held_windows(platform(move.lift_track)), 0, duration_us)
        elif here.track != there.track:
            for segment in junction_segments(self._roads.site, here, there):
                safe = _without(safe, self._held_windows(segment), 0, duration_us)
        else:
            count, step = abs(there.index - here.index), 1 if there.index > here.index else -1
            alike = self._roads.alike(here.track, count)
            held = self._held_on(here.track)
            for offset, enter_us, leave_us in leg_sweeps(self._roads.site, here.track, count)[alike:]:
                windows = held.get(here.index + step * offset)
                if windows:
                    safe = _without(safe, windows, enter_us, leave_us)
            safe = self._sill(safe, here, there)
        return next(first_ms(safe), None)

    def _sill(self, safe: list[Interval], here: Segment, there: Segment) -> list[Interval]:
        """Departures of a run from which the body crosses a lift's sill while the platform is there, at either end."""
        sweeps = leg_sweeps(self._roads.site, here.track, abs(there.index - here.index))
        reach = -sweeps[0].offset
        for position, sweep in ((here, sweeps[reach]), (there, sweeps[-1 - reach])):
            if self._roads.lift_at(position) is not None:
                safe = _without(safe, self._held_windows(position), sweep.enter_us, sweep.leave_us)
        return safe

    def _held_on(self, track: int) -> dict[int, list[Interval]]:
        """What others hold of a track's segments, by index, where they hold any; platforms are left out."""
        found = self._tracks.get(track)
        if found is None:
            found = self._tracks[track] = {}
            for position in self._roads.positions(track):
                windows = self._held_windows(position)
                if windows and self._roads.lift_at(position) is None:
                    found[position.index] = windows
        return found

    def _free_intervals(self, segment: Segment) -> list[Interval]:
        found = self._free.get(segment)
        if found is None:
            found = self._free[segment] = self._find_free(segment)
        return found

    def _find_free(self, segment: Segment) -> list[Interval]:
        stop = self._roads.lift_at(segment)
        if stop is not None:
            return floor_intervals(self._roads.site, stop[0], self.gaps(stop[0]), stop[1])
        if segment.index == PLATFORM_INDEX:
            return [Interval(gap.from_us, gap.to_us) for gap in self.gaps(segment.track)]
        return self._reservations.safe_intervals(segment, self._owner, self._start_us)

    def gaps(self, lift_track: int) -> list[Gap]:
        """The gaps between the others' uses of one lift."""
        found = self._gaps_of.get(lift_track)
        if found is None:
            uses = self._reservations.uses(lift_track, self._owner)
            standing_index = self._lift_floors.get(lift_track, HOME_INDEX)
            found = self._gaps_of[lift_track] = lift_gaps(uses, self._start_us, standing_index)
        return found

    def _held_windows(self, segment: Segment) -> list[Interval]:
        """What others hold of one segment, from the start of the search to all time: between its safe intervals."""
        found = self._held.get(segment)
        if found is None:
            found = self._held[segment] = []
            from_us = self._start_us
            for gap in self._free_intervals(segment):
                if gap.from_us > from_us:
                    found.append(Interval(from_us, gap.from_us))
                from_us = gap.to_us
            if from_us < FOREVER:
                found.append(Interval(from_us, _ALL_TIME))
        return found


def first_ms(departures: list[Interval]) -> Iterator[int]:
    """The first whole millisecond of each interval that has one."""
    for from_us, to_us in departures:
        time_us = ceil_ms(from_us)
        if time_us < to_us:
            yield time_us


def _within(safe: list[Interval], from_us: int, to_us: int) -> list[Interval]:
    """The parts of sorted intervals that lie in ``[from, to)``."""
    return [
        Interval(max(one.from_us, from_us), min(one.to_us, to_us))
        for one in safe
        if one[1] > from_us and one[0] < to_us
    ]


def _without(safe: list[Interval], held: list[Interval], enter_us: int, leave_us: int) -> list[Interval]:
    """Those of the ``safe`` departures after which ``[enter, leave)`` meets none of the ``held`` windows."""
    if not held or not safe:
        return safe
    left = []
    first = 0
    for from_us, to_us in safe:
        begin_us = from_us
        while first < len(held) and held[first].to_us - enter_us <= from_us:
            first += 1
        for place in range(first, len(held)):
            held_from_us, held_to_us = held[place]
            forbidden_us = held_from_us - leave_us + 1
            if forbidden_us >= to_us:
                break
            if forbidden_us > begin_us:
                left.append(Interval(begin_us, forbidden_us))
            begin_us = held_to_us - enter_us
        if begin_us < to_us:
            left.append(Interval(begin_us, to_us))
    return left


def _from_us(interval: Interval) -> int:
    return interval.from_us

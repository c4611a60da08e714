"""When moves can depart around everybody's reservations: what one route search asks, segments looked up once.

A window that the body sweeps ``[enter, leave)`` after the departure and a reservation ``[from, to)`` of the same
segment forbid the departures between ``from - leave`` and ``to - enter``, both excluded. What no pair of them forbids
is a safe departure. Runs in one direction sweep their first segments alike, however far they go: so these are taken
one after the other, and where they leave no departure all longer runs are out of the question too.
"""

from bisect import bisect_right
from collections.abc import Iterator

from onboard.core.kinematics import ceil_ms
from onboard.core.occupancy import Sweep, junction_segments, leg_sweeps
from onboard.core.reservations import FOREVER, Interval, Reservations
from onboard.core.roads import Move, Roads
from onboard.core.site import Segment

#: End of a reservation without end: no window that is swept, however late, comes after it.
_ALL_TIME = 2 * FOREVER


class Departures:
    """Safe intervals for standing and for departing from ``start_us`` on; windows of ``owner`` are no obstacle."""

    def __init__(self, roads: Roads, reservations: Reservations, owner: int, start_us: int) -> None:
        self._roads = roads
        self._reservations = reservations
        self._owner = owner
        self._start_us = start_us
        self._free: dict[Segment, list[Interval]] = {}
        self._held: dict[Segment, list[Interval]] = {}
        self._standing: dict[Segment, list[Interval]] = {}

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

    def moves(self, here: Segment, within: Interval) -> Iterator[tuple[Move, list[Interval]]]:
        """Each move that may be possible from standing at ``here`` during ``within``, with departures to choose from.

        Of runs only what they sweep alike is taken into account yet; ``safe`` settles the rest.
        """
        begun: dict[int, list[list[Interval]]] = {1: [[within]], -1: [[within]]}
        longest = self._roads.longest(here.track)
        for move in self._roads.moves(here):
            there = move.destination
            if here.track != there.track:
                yield move, [within]
                continue
            step = 1 if there.index > here.index else -1
            alike = self._roads.alike(here.track, abs(there.index - here.index))
            safe = self._begin(begun[step], here, step, longest[:alike])
            if safe:
                yield move, safe

    def safe(self, here: Segment, move: Move, choice: list[Interval]) -> list[Interval]:
        """Those of the departures from ``moves`` that are safe all the way, the arrival included, in order."""
        there, duration_us = move.destination, move.duration_us
        safe = choice
        if here.track != there.track:
            for segment in junction_segments(self._roads.site, here, there):
                safe = _without(safe, self._held_windows(segment), 0, duration_us)
        else:
            count, step = abs(there.index - here.index), 1 if there.index > here.index else -1
            alike = self._roads.alike(here.track, count)
            for sweep in leg_sweeps(self._roads.site, here.track, count)[alike:]:
                safe = self._swept(safe, here, step, sweep)
        # To arrive is to stand for an instant at least.
        for segment in self._roads.touched(there):
            safe = _without(safe, self._held_windows(segment), duration_us, duration_us + 1)
        return safe

    def _begin(self, begun: list[list[Interval]], here: Segment, step: int, alike: tuple[Sweep, ...]) -> list[Interval]:
        """What these first sweeps leave over; ``begun`` holds that for each lower number of them and grows."""
        while len(begun) <= len(alike) and begun[-1]:
            begun.append(self._swept(begun[-1], here, step, alike[len(begun) - 1]))
        return begun[len(alike)] if len(alike) < len(begun) else []

    def _swept(self, safe: list[Interval], here: Segment, step: int, sweep: Sweep) -> list[Interval]:
        segment = self._roads.segment(here.track, here.index + step * sweep.offset)
        if segment is None:
            return safe
        return _without(safe, self._held_windows(segment), sweep.enter_us, sweep.leave_us)

    def _free_intervals(self, segment: Segment) -> list[Interval]:
        found = self._free.get(segment)
        if found is None:
            found = self._free[segment] = self._reservations.safe_intervals(segment, self._owner, self._start_us)
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

"""When each move can depart around everybody's reservations: what one route search knows, looked up once.

A window that the body sweeps ``[enter, leave)`` after the departure and a reservation ``[from, to)`` of the same
segment forbid the departures between ``from - leave`` and ``to - enter``, both excluded. What no pair of them forbids
is a safe departure; it is the same for every state that stands at the origin. Runs in one direction sweep their first
segments alike, however far they go, so those are worked out once for all of them.
"""

from bisect import bisect_right

from onboard.core.kinematics import ceil_ms
from onboard.core.occupancy import Sweep, junction_segments, leg_sweeps, standing_segments
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
        self._safe: dict[tuple[Segment, Segment], list[Interval]] = {}
        self._begun: dict[tuple[Segment, int], list[list[Interval]]] = {}

    def standing(self, segment: Segment) -> list[Interval]:
        """When a body may stand at a segment: all that it touches there must be free."""
        found = self._standing.get(segment)
        if found is None:
            touched = standing_segments(self._roads.site, segment)
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

    def safe(self, here: Segment, move: Move) -> list[Interval]:
        """All departures from which every swept window and the arrival are free, in order; take the next whole ms."""
        pair = (here, move.destination)
        found = self._safe.get(pair)
        if found is None:
            found = self._safe[pair] = self._find(here, move)
        return found

    def _find(self, here: Segment, move: Move) -> list[Interval]:
        there, duration_us = move.destination, move.duration_us
        safe = self._run(here, there) if here.track == there.track else self._hop(here, move)
        # To arrive is to stand for an instant at least.
        for segment in standing_segments(self._roads.site, there) if safe else ():
            safe = _without(safe, self._held_windows(segment), duration_us, duration_us + 1)
        return safe

    def _hop(self, here: Segment, move: Move) -> list[Interval]:
        safe = [Interval(self._start_us, FOREVER)]
        for segment in junction_segments(self._roads.site, here, move.destination):
            safe = _without(safe, self._held_windows(segment), 0, move.duration_us)
        return safe

    def _run(self, here: Segment, there: Segment) -> list[Interval]:
        step = 1 if there.index > here.index else -1
        count = abs(there.index - here.index)
        alike = self._roads.alike(here.track, count)
        begun = self._begun.setdefault((here, step), [[Interval(self._start_us, FOREVER)]])
        longest = self._roads.longest(here.track)
        while len(begun) <= alike and begun[-1]:
            begun.append(self._swept(begun[-1], here, step, longest[len(begun) - 1]))
        safe = begun[min(alike, len(begun) - 1)]
        for sweep in leg_sweeps(self._roads.site, here.track, count)[alike:] if safe else ():
            safe = self._swept(safe, here, step, sweep)
        return safe

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


def first_ms(interval: Interval, not_before_us: int) -> int | None:
    """The first whole millisecond of an interval that is not before a time, or None."""
    time_us = ceil_ms(max(interval.from_us, not_before_us))
    return time_us if time_us < interval.to_us else None


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
        for held_from_us, held_to_us in held[first:]:
            forbidden_us = held_from_us - leave_us + 1
            if forbidden_us >= to_us:
                break
            if forbidden_us > begin_us:
                left.append(Interval(begin_us, forbidden_us))
            begin_us = max(begin_us, held_to_us - enter_us)
        if begin_us < to_us:
            left.append(Interval(begin_us, to_us))
    return left


def _from_us(interval: Interval) -> int:
    return interval.from_us

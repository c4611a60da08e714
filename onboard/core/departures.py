"""When each move can depart around everybody's reservations: what one route search knows, looked up once.

A window that the body sweeps ``[enter, leave)`` after the departure and a reservation ``[from, to)`` of the same segment
forbid the departures between ``from - leave`` and ``to - enter``, both excluded. What no pair of them forbids is a safe
departure; it is the same for every state that stands at the origin.
"""

from bisect import bisect_right

from onboard.core.kinematics import ceil_ms
from onboard.core.occupancy import standing_segments
from onboard.core.reservations import FOREVER, Interval, Reservations
from onboard.core.roads import Move, Roads
from onboard.core.site import Segment


class Departures:
    """Safe intervals for standing and for departing from ``start_us`` on; windows of ``owner`` are no obstacle."""

    def __init__(self, roads: Roads, reservations: Reservations, owner: int, start_us: int) -> None:
        self._roads = roads
        self._reservations = reservations
        self._owner = owner
        self._start_us = start_us
        self._gaps: dict[Segment, list[Interval]] = {}
        self._held: dict[Segment, list[Interval]] = {}
        self._standing: dict[Segment, list[Interval]] = {}
        self._safe: dict[tuple[Segment, Segment], list[Interval]] = {}

    def standing(self, segment: Segment) -> list[Interval]:
        """When a body may stand at a segment: all that it touches there must be free."""
        found = self._standing.get(segment)
        if found is None:
            touched = standing_segments(self._roads.site, segment)
            found = self._free(touched[0])
            for other in touched[1:]:
                found = _intersect(found, self._free(other))
            self._standing[segment] = found
        return found

    def standing_at(self, segment: Segment, time_us: int) -> Interval | None:
        """The safe interval for standing at a segment that holds ``time_us``, or None."""
        intervals = self.standing(segment)
        place = bisect_right(intervals, time_us, key=_from_us) - 1
        return intervals[place] if place >= 0 and time_us < intervals[place].to_us else None

    def safe(self, here: Segment, move: Move) -> list[Interval]:
        """All departures, in order, from which every swept window and the arrival are free; begins in whole ms."""
        pair = (here, move.destination)
        found = self._safe.get(pair)
        if found is None:
            found = self._safe[pair] = self._find(here, move)
        return found

    def _find(self, here: Segment, move: Move) -> list[Interval]:
        forbidden = [
            (from_us - leave_us + 1, to_us - enter_us)
            for segment, enter_us, leave_us in self._roads.swept(here, move.destination)
            for from_us, to_us in self._held_windows(segment)
        ]
        stays = self._complement(self.standing(move.destination))
        forbidden += [(from_us - move.duration_us, to_us - move.duration_us) for from_us, to_us in stays]
        forbidden.sort()
        return _outside(forbidden, self._start_us)

    def _free(self, segment: Segment) -> list[Interval]:
        found = self._gaps.get(segment)
        if found is None:
            found = self._gaps[segment] = self._reservations.safe_intervals(segment, self._owner, self._start_us)
        return found

    def _held_windows(self, segment: Segment) -> list[Interval]:
        found = self._held.get(segment)
        if found is None:
            found = self._held[segment] = self._complement(self._free(segment))
        return found

    def _complement(self, gaps: list[Interval]) -> list[Interval]:
        """The windows between sorted gaps, from the start of the search to all time."""
        held = []
        from_us = self._start_us
        for gap in gaps:
            if gap.from_us > from_us:
                held.append(Interval(from_us, gap.from_us))
            from_us = gap.to_us
        if from_us < FOREVER:
            held.append(Interval(from_us, FOREVER))
        return held


def _outside(forbidden: list[tuple[int, int]], start_us: int) -> list[Interval]:
    """What sorted half-open intervals leave over from ``start_us`` on, with begins rounded up to whole ms."""
    found = []
    free_us = start_us
    for from_us, to_us in forbidden:
        begin_us = ceil_ms(free_us)
        if begin_us < from_us:
            found.append(Interval(begin_us, from_us))
        free_us = max(free_us, to_us)
    # Past the longest move before all time ends, only what is for ever is held.
    if free_us < FOREVER // 2:
        found.append(Interval(ceil_ms(free_us), FOREVER))
    return found


def _intersect(first: list[Interval], second: list[Interval]) -> list[Interval]:
    """Common parts of two sorted lists of intervals, in order."""
    common = []
    one = two = 0
    while one < len(first) and two < len(second):
        from_us, to_us = max(first[one].from_us, second[two].from_us), min(first[one].to_us, second[two].to_us)
        if from_us < to_us:
            common.append(Interval(from_us, to_us))
        if first[one].to_us < second[two].to_us:
            one += 1
        else:
            two += 1
    return common


def _from_us(interval: Interval) -> int:
    return interval.from_us

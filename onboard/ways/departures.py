"""Safe intervals around everybody's reservations, worked out once and kept until a plan changes them.

A window that the body sweeps ``[enter, leave)`` after the departure and a reservation ``[from, to)`` of the same
segment forbid the departures between ``from - leave`` and ``to - enter``, both excluded. What no pair of them forbids
is a safe departure.

A platform has safe intervals for each floor by itself: when the lift can be there. The platform as such is one resource
more, free in the gaps between the others' uses: for the rides.
"""

from bisect import bisect_right
from collections.abc import Mapping

from onboard.core.site import Segment
from onboard.ways.lift_uses import HOME_INDEX, Gap, floor_intervals, lift_gaps
from onboard.ways.lifts import PLATFORM_INDEX
from onboard.ways.reservations import FOREVER, Interval, Reservations
from onboard.ways.roads import Roads

#: End of a reservation without end: no window that is swept, however late, comes after it.
_ALL_TIME = 2 * FOREVER

#: What others hold of a segment: the begins of the windows in order, and their ends. They do not overlap.
Held = tuple[tuple[int, ...], tuple[int, ...]]
_NOTHING: Held = ((), ())


class Departures:
    """Safe intervals from ``start_us`` on; windows of ``owner`` are no obstacle."""

    def __init__(
        self, roads: Roads, reservations: Reservations, owner: int, start_us: int, lift_floors: Mapping[int, int]
    ) -> None:
        self.roads = roads
        self._lift_floors = lift_floors
        self._gaps_of: dict[int, list[Gap]] = {}
        self._planned = reservations.planned()
        self._owner = owner
        self._start_us = start_us
        #: Where nobody plans to be: one list for all.
        self._always = [Interval(start_us, FOREVER)]
        self._held: dict[Segment, Held] = {}
        self._tracks: dict[int, dict[int, Held]] = {}

    def standing(self, segment: Segment) -> list[Interval]:
        """When a body may stand at a segment: all that it touches there must be free."""
        touched = self.roads.touched(segment)
        found = self._free(touched[0])
        for other in touched[1:]:
            found = _without(found, self.held(other))
        return found

    def held(self, segment: Segment) -> Held:
        """What others hold of one segment, from the start of the search to all time: between its safe intervals."""
        found = self._held.get(segment)
        if found is None:
            begins: list[int] = []
            ends: list[int] = []
            from_us = self._start_us
            for gap in self._free(segment):
                if gap.from_us > from_us:
                    begins.append(from_us)
                    ends.append(gap.from_us)
                from_us = gap.to_us
            if from_us < FOREVER:
                begins.append(from_us)
                ends.append(_ALL_TIME)
            found = self._held[segment] = (tuple(begins), tuple(ends)) if begins else _NOTHING
        return found

    def held_until_us(self, segment: Segment) -> int:
        """When anybody else holds a segment, or a platform is away, for the last time; 0 where never."""
        _, ends = self.held(segment)
        return ends[-1] if ends else 0

    def held_on(self, track: int) -> dict[int, Held]:
        """What others hold of a track's segments, by index, where they hold any; platforms are left out."""
        found = self._tracks.get(track)
        if found is None:
            found = self._tracks[track] = {}
            for position in self.roads.positions(track):
                if self.roads.lift_at(position) is None and self.held(position)[0]:
                    found[position.index] = self.held(position)
        return found

    def _free(self, segment: Segment) -> list[Interval]:
        stop = self.roads.lift_at(segment)
        if stop is not None:
            return floor_intervals(self.roads.site, stop[0], self.gaps(stop[0]), stop[1])
        if segment.index == PLATFORM_INDEX:
            return [Interval(gap.from_us, gap.to_us) for gap in self.gaps(segment.track)]
        if not self._planned.on(segment):
            return self._always
        return self._planned.safe_intervals(segment, self._owner, self._start_us)

    def gaps(self, lift_track: int) -> list[Gap]:
        """The gaps between the others' uses of one lift."""
        found = self._gaps_of.get(lift_track)
        if found is None:
            uses = self._planned.uses(lift_track, self._owner)
            standing_index = self._lift_floors.get(lift_track, HOME_INDEX)
            found = self._gaps_of[lift_track] = lift_gaps(uses, self._start_us, standing_index)
        return found


def _without(safe: list[Interval], held: Held) -> list[Interval]:
    """The parts of ``safe`` in which nothing is held."""
    begins, ends = held
    if not begins or not safe:
        return safe
    left = []
    for from_us, to_us in safe:
        begin_us = from_us
        for place in range(bisect_right(ends, from_us), len(ends)):
            if begins[place] >= to_us:
                break
            if begins[place] > begin_us:
                left.append(Interval(begin_us, begins[place]))
            begin_us = ends[place]
        if begin_us < to_us:
            left.append(Interval(begin_us, to_us))
    return left

"""What a carrier can drive on by itself: whole rest-to-rest runs along tracks, and hops through the mouths of spurs.

Built once for a site and kept: run tables are the same for every search. Lift shafts are left out, as nobody drives
along them; a lift will be one more kind of move between segments.
"""

from collections.abc import Iterator
from heapq import heappop, heappush
from typing import NamedTuple

from onboard.core.kinematics import run_duration_us
from onboard.core.occupancy import Sweep, leg_sweeps, standing_segments
from onboard.core.reservations import FOREVER
from onboard.core.site import Segment, Site, TrackKind

#: Sites whose tables are kept in one process: one in a machine, some in a test run.
_MAX_KEPT = 16


class Move(NamedTuple):
    """One move between two segments at rest; ``distance_mm`` is what the carrier travels."""

    destination: Segment
    duration_us: int
    distance_mm: int


class Roads:
    """Moves and shortest times of one site."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self._segments: dict[int, tuple[Segment, ...]] = {}
        self._run_us: dict[int, tuple[int, ...]] = {}
        self._hops: dict[Segment, list[Move]] = {}
        self._junctions: dict[int, list[Segment]] = {}
        self._moves: dict[Segment, tuple[Move, ...]] = {}
        self._touched: dict[Segment, list[Segment]] = {}
        self._longest: dict[int, tuple[Sweep, ...]] = {}
        self._alike: dict[tuple[int, int], int] = {}
        self._to_goal: dict[Segment, dict[Segment, int]] = {}
        for track in site.tracks.values():
            if track.kind is not TrackKind.LIFT:
                durations = (run_duration_us(count * track.pitch_mm, site.carrier) for count in range(track.length))
                self._run_us[track.number] = tuple(durations)
                self._segments[track.number] = tuple(Segment(track.number, i) for i in range(1, track.length + 1))
            if track.kind is TrackKind.SPUR:
                hop_us = run_duration_us(track.pitch_mm, site.carrier)
                for mouth in track.joins:
                    self._join(mouth, Segment(track.number, 1), hop_us, track.pitch_mm)

    def _join(self, one: Segment, other: Segment, hop_us: int, distance_mm: int) -> None:
        for here, there in ((one, other), (other, one)):
            self._hops.setdefault(here, []).append(Move(there, hop_us, distance_mm))
            junctions = self._junctions.setdefault(here.track, [])
            if here not in junctions:
                junctions.append(here)

    def knows(self, segment: Segment) -> bool:
        """Whether a carrier can be at a segment: it is on an alley or a spur of the site."""
        return 1 <= segment.index <= len(self._segments.get(segment.track, ()))

    def segment(self, track: int, index: int) -> Segment | None:
        """The segment of a track, or None beyond its ends."""
        segments = self._segments[track]
        return segments[index - 1] if 0 < index <= len(segments) else None

    def touched(self, segment: Segment) -> list[Segment]:
        """Segments that a carrier standing at ``segment`` occupies."""
        found = self._touched.get(segment)
        if found is None:
            found = self._touched[segment] = standing_segments(self.site, segment)
        return found

    def moves(self, here: Segment) -> tuple[Move, ...]:
        """All moves from a segment: runs by growing index, then hops in the order of the site's tracks."""
        found = self._moves.get(here)
        if found is None:
            found = self._moves[here] = (*self._runs(here), *self._hops.get(here, ()))
        return found

    def _runs(self, here: Segment) -> Iterator[Move]:
        durations, pitch_mm = self._run_us[here.track], self.site.tracks[here.track].pitch_mm
        for there in self._segments[here.track]:
            count = abs(there.index - here.index)
            if count:
                yield Move(there, durations[count], count * pitch_mm)

    def longest(self, track: int) -> tuple[Sweep, ...]:
        """Sweeps of a run from one end of a track to the other; none where it has but one segment."""
        found = self._longest.get(track)
        if found is None:
            count = len(self._segments[track]) - 1
            found = self._longest[track] = leg_sweeps(self.site, track, count) if count else ()
        return found

    def alike(self, track: int, count: int) -> int:
        """How many of its first sweeps a run over ``count`` steps shares with the longest one of the track."""
        found = self._alike.get((track, count))
        if found is None:
            sweeps = leg_sweeps(self.site, track, count)
            pairs = zip(sweeps, self.longest(track), strict=False)
            found = next((n for n, (one, other) in enumerate(pairs) if one != other), len(sweeps))
            self._alike[track, count] = found
        return found

    def shortest_us(self, origin: Segment, goal: Segment) -> int:
        """Least time between two segments of the roads with nobody in the way; FOREVER where there is no way."""
        direct_us = (
            self._run_us[origin.track][abs(origin.index - goal.index)] if origin.track == goal.track else FOREVER
        )
        if origin.track not in self._junctions:
            return direct_us
        durations = self._run_us[origin.track]
        through_us = (
            durations[abs(origin.index - junction.index)] + rest_us
            for junction, rest_us in self._junctions_to(goal).items()
            if junction.track == origin.track
        )
        return min(direct_us, min(through_us, default=FOREVER))

    def _junctions_to(self, goal: Segment) -> dict[Segment, int]:
        """Least time from each junction to ``goal`` (Dijkstra 1959); moves take the same time both ways."""
        found = self._to_goal.get(goal)
        if found is not None:
            return found
        found = self._to_goal[goal] = {}
        queue = [(0, goal)]
        closed: set[Segment] = set()
        while queue:
            time_us, here = heappop(queue)
            if here in closed:
                continue
            closed.add(here)
            if here in self._hops:
                found[here] = time_us
            for hop in self._hops.get(here, ()):
                heappush(queue, (time_us + hop.duration_us, hop.destination))
            for junction in self._junctions.get(here.track, ()):
                heappush(queue, (time_us + self._run_us[here.track][abs(here.index - junction.index)], junction))
        return found


_kept: dict[int, Roads] = {}


def roads_of(site: Site) -> Roads:
    """The roads of a site, built at the first call for this very object."""
    roads = _kept.get(id(site))
    # A kept table holds its site, so an identity in use is never that of another site.
    if roads is None:
        if len(_kept) >= _MAX_KEPT:
            del _kept[next(iter(_kept))]
        roads = _kept[id(site)] = Roads(site)
    return roads

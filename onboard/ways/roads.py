"""What a carrier can do by itself or with a lift: rest-to-rest runs along tracks, hops through mouths, rides.

Built once for a site and kept: run tables are the same for every search. A lift's platform is a position at the end of
each alley that it serves, index 0 or length + 1; a ride is a move from one of them to another.
"""

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property
from operator import ne
from typing import NamedTuple

from onboard.core.site import Segment
from onboard.ways.kept import Kept
from onboard.ways.kinematics import run_duration_us
from onboard.ways.lift_uses import ride_us
from onboard.ways.lifts import lift_tracks, platform_on
from onboard.ways.network import Network
from onboard.ways.occupancy import Sweep, alley_segments, leg_sweeps, turn_in_us
from onboard.ways.reservations import FOREVER
from onboard.ways.site import TrackKind, WaySite

#: Goals, and sets of them, whose tables are kept for one site.
_MAX_GOALS = 1_024
#: Pairs of positions whose least time is kept: bids ask for those between compartments and places again and again.
_MAX_SHORTEST = 4_096
#: Goals whose least times from each position are kept.
_MAX_WAYS = 32


class Move(NamedTuple):
    """One move between two positions at rest; ``distance_mm`` is what the carrier drives.

    ``lift_track`` is the lift's where the move is a ride.
    """

    destination: Segment
    duration_us: int
    distance_mm: int
    lift_track: int | None = None


class Roads:
    """Moves and shortest times of one site. A position is a segment of an alley or spur, or a platform."""

    def __init__(self, site: WaySite) -> None:
        self.site = site
        self._positions: dict[int, dict[int, Segment]] = {}
        self._run_us: dict[int, tuple[int, ...]] = {}
        self._hops: dict[Segment, list[Move]] = {}
        self._junctions: dict[int, list[Segment]] = {}
        self._platforms: dict[Segment, tuple[int, int]] = {}
        self._runs: dict[int, RunsOn] = {}
        self._touched: dict[Segment, list[Segment]] = {}
        self._longest: dict[int, tuple[Sweep, ...]] = {}
        self._swept: dict[tuple[int, int], tuple[tuple[Sweep, ...], int]] = {}
        #: How runs end: direction and last sweeps, with offsets and times counted from where and when they arrive.
        self.tails: list[tuple[int, tuple[Sweep, ...]]] = []
        self._tails: dict[tuple[int, tuple[Sweep, ...]], int] = {}
        self._tail_of: dict[tuple[int, int], int] = {}
        self._ways_us: dict[frozenset[Segment], WaysToGoals] = {}
        self._shortest_us: dict[tuple[Segment, Segment], int] = {}
        self._to_goals: dict[frozenset[Segment], _Ways] = {}
        for track in site.tracks.values():
            if track.kind is not TrackKind.LIFT:
                indices = range(1, track.length + 1)
                self._positions[track.number] = {index: Segment(track.number, index) for index in indices}
        for lift_track in lift_tracks(site):
            self._add_lift(lift_track)
        for number, positions in self._positions.items():
            pitch_mm = site.tracks[number].pitch_mm
            durations = (run_duration_us(count * pitch_mm, site.carrier) for count in range(len(positions)))
            self._run_us[number] = tuple(durations)
        for track in site.tracks.values():
            hop_us = turn_in_us(site, track.number) if track.ends else 0
            for index, mouth in track.ends:
                inside = track.inside(index)
                if track.goes(index, inside.index):
                    self._join(mouth, Move(inside, hop_us, track.pitch_mm))
                if track.goes(inside.index, index):
                    self._join(inside, Move(mouth, hop_us, track.pitch_mm))

    def _add_lift(self, lift_track: int) -> None:
        """A position at the end of each alley that the lift serves, and the rides between them."""
        aboard: list[Segment] = []
        for lift_index, sill in enumerate(self.site.tracks[lift_track].joins, start=1):
            position = platform_on(self.site, lift_track, sill.track)
            if position is not None:
                self._platforms[position] = lift_track, lift_index
                self._positions[sill.track][position.index] = position
                aboard.append(position)
        for here in aboard:
            for there in aboard:
                if here != there:
                    # Between two doors of one stop the platform stays where it is.
                    duration_us = ride_us(self.site, lift_track, self._platforms[here][1], self._platforms[there][1])
                    self._join(here, Move(there, duration_us, 0, lift_track))

    def _join(self, here: Segment, hop: Move) -> None:
        self._hops.setdefault(here, []).append(hop)
        for end in (here, hop.destination):
            junctions = self._junctions.setdefault(end.track, [])
            if end not in junctions:
                junctions.append(end)

    def knows(self, position: Segment) -> bool:
        """Whether a carrier can be at a position of this site."""
        return position.index in self._positions.get(position.track, ())

    def lift_at(self, position: Segment) -> tuple[int, int] | None:
        """Lift track and lift index where a position is a platform, else None."""
        return self._platforms.get(position)

    def segment(self, track: int, index: int) -> Segment | None:
        """The segment of a track, or None beyond its ends; a platform is none."""
        return self._positions[track].get(index) if 0 < index <= self.site.tracks[track].length else None

    def touched(self, position: Segment) -> list[Segment]:
        """What a carrier standing at a position occupies: that position first if it is a platform, then segments."""
        found = self._touched.get(position)
        if found is None:
            aboard = [position] if position in self._platforms else []
            found = self._touched[position] = aboard + alley_segments(self.site, position)
        return found

    def runs(self, track: int) -> "RunsOn":
        """Runs along a track by the steps that they go, lower indices below 0: they are the same from everywhere."""
        found = self._runs.get(track)
        if found is None:
            found = self._runs[track] = RunsOn(self, track)
        return found

    def run(self, track: int, steps: int) -> "_Run":
        """The run over so many steps of a track, lower indices below 0."""
        count = abs(steps)
        sweeps, alike = self.swept(track, count)
        pitch_mm, reach = self.site.tracks[track].pitch_mm, -sweeps[0].offset
        return self._run_us[track][count], count * pitch_mm, alike, self._tail(track, steps), sweeps[reach].leave_us

    def _tail(self, track: int, steps: int) -> int:
        """How runs over so many steps end, lower indices below 0: their place among ``tails``."""
        found = self._tail_of.get((track, steps))
        if found is not None:
            return found
        (sweeps, alike), end_us = self.swept(track, abs(steps)), self._run_us[track][abs(steps)]
        reach, last = -sweeps[0].offset, sweeps[-1].offset + sweeps[0].offset
        # The sweep of where it ends is among the last ones in any case: there may be a sill.
        tail = tuple(
            Sweep(offset - last, enter_us - end_us, leave_us - end_us)
            for offset, enter_us, leave_us in sweeps[min(alike, reach + last) :]
        )
        step = 1 if steps > 0 else -1
        number = self._tail_of[track, steps] = self._tails.setdefault((step, tail), len(self.tails))
        if number == len(self.tails):
            self.tails.append((step, tail))
        return number

    def leads(self, track: int, steps: int) -> bool:
        """Whether a run along a track may go so many steps, lower indices below 0."""
        return steps != 0

    def hops(self, here: Segment) -> Sequence[Move]:
        """Hops and rides from a position, in the order of the site's tracks."""
        return self._hops.get(here, ())

    def run_us(self, track: int, count: int) -> int:
        """Duration of a run over ``count`` steps of a track."""
        return self._run_us[track][count]

    def positions(self, track: int) -> Collection[Segment]:
        """All positions on an alley or spur."""
        return self._positions[track].values()

    def junctions(self, track: int) -> list[Segment]:
        """Positions of a track at which one goes to another, or comes from it: platforms, mouths, segments inside."""
        return self._junctions.get(track, [])

    def longest(self, track: int) -> tuple[Sweep, ...]:
        """Sweeps of a run from one end of a track to the other; none where it has but one position."""
        found = self._longest.get(track)
        if found is None:
            count = len(self._positions[track]) - 1
            found = self._longest[track] = leg_sweeps(self.site, track, count) if count else ()
        return found

    def swept(self, track: int, count: int) -> tuple[tuple[Sweep, ...], int]:
        """Sweeps of a run over ``count`` steps of a track; how many of the first it shares with the longest one."""
        found = self._swept.get((track, count))
        if found is None:
            sweeps = leg_sweeps(self.site, track, count)
            differ = [*map(ne, sweeps, self.longest(track))]
            found = self._swept[track, count] = sweeps, differ.index(True) if True in differ else len(sweeps)
        return found

    def shortest_us(self, origin: Segment, goal: Segment) -> int:
        """Least time between two positions with nobody in the way and every lift at hand; FOREVER without a way.

        Also from where no carrier can be at rest: a machine that stopped amid a hop says that it is there.
        """
        found = self._shortest_us.get((origin, goal))
        if found is None:
            if len(self._shortest_us) >= _MAX_SHORTEST:
                self._shortest_us.clear()
            found = self._shortest_us[origin, goal] = self.nearest_us(origin, frozenset((goal,)))
        return found

    def nearest_us(self, origin: Segment, goals: frozenset[Segment]) -> int:
        """Least time to any of ``goals`` as in ``shortest_us``."""
        if not self.knows(origin):
            return FOREVER
        ways = self._ways_to(goals)
        durations = self._run_us[origin.track]
        least_us = FOREVER
        for index, rest_us in ways.get(origin.track, ()):
            least_us = min(least_us, durations[abs(origin.index - index)] + rest_us)
        return least_us

    def ways_us(self, goals: frozenset[Segment]) -> "WaysToGoals":
        """Least times to any of ``goals`` from everywhere, kept for the goals that were asked for last."""
        found = self._ways_us.pop(goals, None)
        if found is None:
            found = WaysToGoals(self, goals)
            if len(self._ways_us) >= _MAX_WAYS:
                del self._ways_us[next(iter(self._ways_us))]
        self._ways_us[goals] = found
        return found

    def _ways_to(self, goals: frozenset[Segment]) -> "_Ways":
        """Goals and junctions by track, with the least time from each to a goal."""
        found = self._to_goals.get(goals)
        if found is not None:
            return found
        if len(self._to_goals) >= _MAX_GOALS:
            self._to_goals.clear()
        found = self._to_goals[goals] = {}
        # One comes to a goal from a junction of its track, and to that from everywhere else.
        starts = {goal: 0 for goal in sorted(goals) if self.knows(goal)}
        for goal in [*starts]:
            for junction, run_us in self._junctions_before(goal):
                starts[junction] = min(run_us, starts.get(junction, FOREVER))
        times_us = self.network.costs_to(starts)
        for here, time_us in times_us.items():
            found.setdefault(here.track, []).append((here.index, time_us))
        return found

    @cached_property
    def network(self) -> Network[Segment]:
        """Junctions of all tracks and the moves between them, us: hops, rides, and runs along the track."""
        ways: dict[Segment, list[tuple[Segment, int]]] = {
            one: [(hop.destination, hop.duration_us) for hop in self.hops(one)]
            for on_track in self._junctions.values()
            for one in on_track
        }
        for there in ways:
            for here, run_us in self._junctions_before(there):
                if here != there:
                    ways[here].append((there, run_us))
        return Network(ways)

    def _junctions_before(self, here: Segment) -> Iterator[tuple[Segment, int]]:
        """Junctions of a position's track from which a run leads to it, with its duration."""
        durations = self._run_us[here.track]
        for one in self._junctions.get(here.track, ()):
            yield one, durations[abs(here.index - one.index)]


class RunsOn(dict[int, "_Run | None"]):
    """Runs along one track by their steps, None where none may go there; worked out when asked for.

    Nothing is asked of where a run begins or ends: both are positions of the track.
    """

    def __init__(self, roads: Roads, track: int) -> None:
        super().__init__()
        self._roads, self._track = roads, track

    def __missing__(self, steps: int) -> "_Run | None":
        roads, track = self._roads, self._track
        found = self[steps] = roads.run(track, steps) if roads.leads(track, steps) else None
        return found


class WaysToGoals:
    """Least times from positions to any of some goals, as in ``Roads.nearest_us``, worked out when asked for."""

    def __init__(self, roads: Roads, goals: frozenset[Segment]) -> None:
        self._roads, self._goals = roads, goals
        self._from: dict[Segment, int] = {}

    def to_us(self, origin: Segment) -> int:
        """Least time from a position in microseconds; FOREVER without a way."""
        found = self._from.get(origin)
        if found is None:
            found = self._from[origin] = self._roads.nearest_us(origin, self._goals)
        return found


class DirectedRoads(Roads):
    """Roads of a site with one-way tracks: other sites need not ask for the direction of each run."""

    def nearest_us(self, origin: Segment, goals: frozenset[Segment]) -> int:
        """Least time to any of ``goals`` as in ``shortest_us``."""
        if not self.knows(origin):
            return FOREVER
        durations, track = self._run_us[origin.track], self.site.tracks[origin.track]
        ways = self._ways_to(goals).get(origin.track, ())
        ahead = [(index, rest_us) for index, rest_us in ways if track.goes(origin.index, index)]
        return min((durations[abs(origin.index - index)] + rest_us for index, rest_us in ahead), default=FOREVER)

    def leads(self, track: int, steps: int) -> bool:
        """Whether a run along a track may go so many steps, lower indices below 0."""
        return super().leads(track, steps) and self.site.tracks[track].goes(0, steps)

    def _junctions_before(self, here: Segment) -> Iterator[tuple[Segment, int]]:
        track = self.site.tracks[here.track]
        return (found for found in super()._junctions_before(here) if track.goes(found[0].index, here.index))


def _build(site: WaySite) -> Roads:
    return DirectedRoads(site) if any(track.one_way for track in site.tracks.values()) else Roads(site)


#: Duration, distance in mm, how many of its first sweeps it shares with the longest run of the track, how it ends (its
#: place among ``Roads.tails``), and when it leaves the segment where it began.
_Run = tuple[int, int, int, int, int]
#: By track: index and time from there to a goal.
_Ways = dict[int, list[tuple[int, int]]]


_roads: Kept[WaySite, Roads] = Kept(_build)


def roads_of(site: WaySite) -> Roads:
    """The roads of a site, built at the first call for this very object."""
    return _roads.of(site)

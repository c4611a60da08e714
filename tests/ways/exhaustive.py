"""An exhaustive search that shares nothing with the planner but the problem, for small sites on a grid of 5 ms.

The axis is chosen so that arithmetic by hand works: segments of 10 mm, 1 m/s, and a ramp of 5 mm in 10 ms. After j
half segments (5 mm) of a run over n segments the carrier has travelled for j + 1 ticks of 5 ms (0 < j < 2n), and the
run takes 2n + 2 ticks. Every border of every body of whole half segments is crossed at a tick, so an optimal plan
departs at ticks. Whole times of departure are bits of an integer; states are stepped tick by tick.
"""

from dataclasses import dataclass, field
from itertools import product

from onboard.ways.site import Axis

TICK_US = 5_000
PITCH_MM = 10
AXIS = Axis(1_000, 100_000)
#: No window but an endless one ends after ``BUSY`` ticks; no sensible plan lasts longer than ``HORIZON``.
BUSY = 40
HORIZON = 160
_BITS = HORIZON + 64

Place = tuple[int, int]  # track, index


@dataclass(frozen=True)
class Problem:
    """One query in ticks. ``held`` has (place, from, to or None for ever), ``visits`` (place, dwell, not before).

    ``turn`` is how long it takes to turn in the mouth of the spur, either way.
    """

    length: int
    half_body: int
    spur_at: int | None
    held: tuple[tuple[Place, int, int | None], ...]
    start: Place
    start_tick: int
    visits: tuple[tuple[Place, int, int], ...]
    refuges: frozenset[Place]
    turn: int = 0


@dataclass(frozen=True)
class Edge:
    """A move with its windows: (place, enter, leave) in ticks after the departure."""

    origin: Place
    goal: Place
    duration: int
    windows: tuple[tuple[Place, int, int], ...]


def _crossing(half_segments: int, segments: int) -> int:
    if half_segments <= 0:
        return 0
    return half_segments + 1 if half_segments < 2 * segments else 2 * segments + 2


@dataclass
class Exhaustive:
    """All plans of one problem."""

    problem: Problem
    free: dict[Place, int] = field(default_factory=dict)
    stand: dict[Place, int] = field(default_factory=dict)
    departures: dict[Place, list[tuple[Edge, int]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        problem = self.problem
        everywhere = [(1, i) for i in range(1, problem.length + 1)]
        if problem.spur_at is not None:
            everywhere += [(192, 1), (192, 2)]
        for place in everywhere:
            self.free[place] = (1 << _BITS) - 1
        for place, begin, end in problem.held:
            last = _BITS if end is None else end
            self.free[place] &= ~(((1 << (last - begin)) - 1) << begin)
        for place in everywhere:
            self.stand[place] = (1 << _BITS) - 1
            for touched in self.touched(place):
                self.stand[place] &= self.free[touched]
        for edge in self.edges(everywhere):
            allowed = (1 << HORIZON) - 1
            for place, enter, leave in edge.windows:
                for tick in range(enter, leave):
                    allowed &= self.free[place] >> tick
            self.departures.setdefault(edge.origin, []).append((edge, allowed))

    def touched(self, place: Place) -> list[Place]:
        """Places that a standing body overlaps: its half length against the distance to their borders."""
        track, index = place
        return [
            (track, other)
            for other in range(1, (self.problem.length if track == 1 else 2) + 1)
            if 2 * abs(other - index) - 1 < self.problem.half_body
        ]

    def edges(self, everywhere: list[Place]) -> list[Edge]:
        """All moves."""
        pairs = product(everywhere, everywhere)
        found = [self.run(here, there) for here, there in pairs if here[0] == there[0] and here != there]
        if self.problem.spur_at is not None:
            mouth, inside = (1, self.problem.spur_at), (192, 1)
            hop = 4 + self.problem.turn
            windows = tuple((place, 0, hop) for place in self.touched(mouth) + self.touched(inside))
            found += [Edge(mouth, inside, hop, windows), Edge(inside, mouth, hop, windows)]
        return found

    def run(self, origin: Place, goal: Place) -> Edge:
        """One run: a place is held while the body overlaps it, however far away."""
        n = abs(goal[1] - origin[1])
        windows = []
        for index in range(1, (self.problem.length if origin[0] == 1 else 2) + 1):
            ahead = (index - origin[1]) * (1 if goal[1] > origin[1] else -1)
            near, far = 2 * ahead - 1 - self.problem.half_body, 2 * ahead + 1 + self.problem.half_body
            if near < 2 * n and far > 0:
                windows.append(((origin[0], index), _crossing(near, n), _crossing(far, n)))
        return Edge(origin, goal, 2 * n + 2, tuple(windows))

    def spread(self, place: Place, times: int) -> dict[Place, int]:
        """All (place, tick) at which one can be at rest, having been at ``place`` at any of ``times``."""
        at = dict.fromkeys(self.free, 0)
        at[place] = times
        for tick in range(HORIZON):
            for here in at:
                if not (at[here] & self.stand[here]) >> tick & 1:
                    continue
                at[here] |= 1 << (tick + 1)
                for edge, allowed in self.departures.get(here, ()):
                    if allowed >> tick & 1:
                        at[edge.goal] |= 1 << (tick + edge.duration)
        return at

    def dwells(self, at: int, visit: tuple[Place, int, int]) -> int:
        """All ends of a dwell for a body that can be there at the ticks ``at``."""
        place, dwell, not_before = visit
        begins = at & self.stand[place] & ~((1 << not_before) - 1)
        for tick in range(dwell):
            begins &= self.stand[place] >> tick
        return begins << dwell & ((1 << HORIZON) - 1)

    def rest(self, place: Place, times: int) -> int | None:
        """The earliest rest for ever in a refuge, having been at ``place`` at one of ``times``."""
        at = self.spread(place, times)
        best = None
        for refuge in self.problem.refuges:
            for tick in range(HORIZON):
                for_ever = self.stand[refuge] >> tick == (1 << (_BITS - tick)) - 1
                if at[refuge] >> tick & 1 and for_ever:
                    best = tick if best is None else min(best, tick)
                    break
        return best

    def solve(self) -> tuple[int, int] | None:
        """(end of the last visit, arrival in the refuge) in ticks, the least there is; None where there is no plan."""
        place, times = self.problem.start, 1 << self.problem.start_tick
        if not self.stand[place] >> self.problem.start_tick & 1:
            return None
        for visit in self.problem.visits:
            times = self.dwells(self.spread(place, times)[visit[0]], visit)
            place = visit[0]
        if self.rest(place, times) is None:
            return None
        ends = [tick for tick in range(HORIZON) if times >> tick & 1]
        for end in ends:
            rest = self.rest(place, 1 << end)
            if rest is not None:
                return (end if self.problem.visits else rest), rest
        raise AssertionError("some end leads to a refuge, but none does")

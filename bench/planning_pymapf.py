"""The planner beside pymapf's SIPP on the same problems: a park seen as a grid, everything in whole ticks.

    python bench/planning_pymapf.py [--queries N] [--seed S]

One place and one floor take a tick, a ride a tick more, carriers are as long as a place and speed up at once. So both
planners can be as good as the other: pymapf (https://github.com/openplan-labs/pymapf, 0.9) moves from cell to cell,
ours in runs of any length. What others hold becomes vertex constraints: a carrier that comes from, or goes to, the next
cell is in both for that tick, so a cell held during ``[a, b)`` is forbidden from tick a to tick b. A lift is a row of
cells beside its platforms that is forbidden while others use the lift. pymapf plans one leg, and to where nobody comes
any more; its two legs are two searches, the second around what is left after the first. Only searches are timed
(processor time), with all of pymapf's constraints made before, and its heuristic once as the distance on the grid (its
default) and once as the true distances, worked out before.
"""

import argparse
import importlib
import random
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways.departures import Departures
from onboard.ways.reservations import Interval
from onboard.ways.roads import Roads, roads_of
from onboard.ways.sipp import Route, Visit, plan_route
from onboard.ways.site import Axis, TrackKind
from tests.ways.fleets import MAX_EXPANSIONS, Fleet, park

TICK_US = 400_000
#: So long that rounding to mm, and a body shorter than a place by a trifle, are less than a millisecond in a tick.
PITCH_MM, BODY_MM = 2_400_000, 2_399_800
#: A trifle above one place a tick, at once.
AXIS = Axis(6_000_001, 10**16)
DWELL_TICKS = 38
#: What others hold for ever ends for pymapf so many ticks after everything else.
HORIZON_TICKS = 4_000
#: Row (floor) and column; columns 0 and length + 1 are platforms, those beyond the lifts' shafts.
Cell = tuple[int, int]
Blocked = set[tuple[Cell, int]]


def grid_park(floors: int, length: int, compartments: int) -> CarPark:
    """A park in which everything takes whole ticks."""
    site = park(floors, length, compartments)
    tracks = {number: replace(track, pitch_mm=PITCH_MM) for number, track in site.tracks.items()}
    return replace(
        site,
        tracks=tracks,
        carrier=AXIS,
        lift=AXIS,
        carrier_length_mm=BODY_MM,
        carrier_clearance_mm=0,
        floor_height_mm=PITCH_MM,
    )


class GridOfSite:
    """What pymapf's searches ask of a grid: the neighbours of a cell, and how many cells there are."""

    def __init__(self, site: CarPark) -> None:
        self.roads: Roads = roads_of(site)
        self.length = site.tracks[1].length
        floors = sorted(number for number, track in site.tracks.items() if track.kind is TrackKind.ALLEY)
        self.next_to: dict[Cell, list[Cell]] = {}
        for floor in floors:
            for here, there in pairwise((floor, column) for column in range(self.length + 2)):
                self._join(here, there)
                self._join(there, here)
            for shaft, aboard in ((-1, 0), (self.length + 2, self.length + 1)):
                self._join((floor, aboard), (floor, shaft))
                for other in (floor - 1, floor + 1):
                    if other in floors:
                        self._join((floor, shaft), (other, shaft))
                        self._join((floor, shaft), (other, aboard))
        self.free_cells = len(self.next_to)

    def _join(self, here: Cell, there: Cell) -> None:
        self.next_to.setdefault(here, []).append(there)

    def neighbors(self, cell: Cell, allow_diagonals: bool = False) -> list[Cell]:
        """In the order that they were joined in: pymapf's answer to a tie depends on it."""
        return [] if allow_diagonals else self.next_to[cell]

    def distance(self, one: Cell, other: Cell) -> float:
        """Manhattan distance; a shaft counts as the platform beside it, or it could be too much."""
        columns = [min(max(column, 0), self.length + 1) for _, column in (one, other)]
        return float(abs(one[0] - other[0]) + abs(columns[0] - columns[1]))


class Held(NamedTuple):
    """Others' plans as pymapf's constraints: forbidden stays, and steps (onto a platform that is just there)."""

    stays: Blocked
    steps: set[tuple[Cell, Cell, int]]


def held_by_others(grid: GridOfSite, departures: Departures) -> Held:
    """What a carrier that plans at tick 0 has to keep away from."""
    held = Held(set(), set())
    for floor, column in list(grid.next_to):
        position = Segment(floor, column)
        if grid.roads.lift_at(position) is not None:
            free = departures.standing(position)
            held.stays.update(((floor, column), tick) for gap in _between(free) for tick in range(gap[0], gap[1]))
            sill = (floor, 1 if column == 0 else grid.length)
            held.steps.update((sill, (floor, column), _tick(one.from_us)) for one in free)
        elif 1 <= column <= grid.length:
            free = departures.standing(position)
            held.stays.update(((floor, column), tick) for gap in _between(free) for tick in range(gap[0], gap[1] + 1))
        else:
            lift_track = grid.roads.lift_at(Segment(floor, 0 if column < 0 else grid.length + 1))
            assert lift_track is not None
            uses = [Interval(gap.from_us, gap.to_us) for gap in departures.gaps(lift_track[0])]
            held.stays.update(((floor, column), tick) for gap in _between(uses) for tick in range(gap[0], gap[1] + 1))
    return held


def _between(free: list[Interval]) -> list[tuple[int, int]]:
    """The ticks ``[from, to)`` between safe intervals, from 0 to the horizon."""
    ends = [0, *(_tick(time_us) for one in free for time_us in one)]
    if ends[-1] < HORIZON_TICKS:
        ends.append(HORIZON_TICKS)
    return [(ends[n], ends[n + 1]) for n in range(0, len(ends) - 1, 2) if ends[n] < ends[n + 1]]


def _tick(time_us: int) -> int:
    return min(HORIZON_TICKS, round(time_us / TICK_US))


class Peer:
    """pymapf, or a plain word why not."""

    def __init__(self, grid: GridOfSite) -> None:
        try:
            self._sipp = importlib.import_module("pymapf.algorithms.sipp").sipp
            self._constraints = importlib.import_module("pymapf.core.solver").Constraints
            self._true_distance = importlib.import_module("pymapf.core.heuristics").true_distance
        except ImportError:
            print("skipped: pymapf is not installed; pip install 'pymapf>=0.9,<0.10'")
            sys.exit(0)
        self.grid = grid

    def legs(self, held: Held, start: Cell, goals: list[Cell], true_distance: bool) -> tuple[int | None, float]:
        """The tick of arrival at the last goal (None: no way) and the processor microseconds of all searches."""
        at_tick, took_us, here = 0, 0.0, start
        for goal in goals:
            constraints = self._around(held, at_tick)
            measure: Callable[[Cell, Cell], float] = self.grid.distance
            if true_distance:
                measure = self._true_distance(_Backwards(self.grid), goal)
            before = time.process_time_ns()
            path: list[Cell] | None = self._sipp(self.grid, here, goal, constraints, measure)
            took_us += (time.process_time_ns() - before) / 1000
            if path is None:
                return None, took_us
            at_tick, here = at_tick + len(path) - 1, goal
        return at_tick, took_us

    def _around(self, held: Held, from_tick: int) -> Any:
        """Constraints, as pymapf takes them, of a search that begins at a tick."""
        found = self._constraints()
        found.vertex = {(cell, tick - from_tick) for cell, tick in held.stays if tick >= from_tick}
        found.edge = {(one, other, tick - from_tick) for one, other, tick in held.steps if tick >= from_tick}
        return found


class _Backwards:
    """The grid with all steps turned round, for distances to a goal."""

    def __init__(self, grid: GridOfSite) -> None:
        self._next: dict[Cell, list[Cell]] = {}
        for here, others in grid.next_to.items():
            for there in others:
                self._next.setdefault(there, []).append(here)

    def neighbors(self, cell: Cell, allow_diagonals: bool = False) -> list[Cell]:
        return self._next[cell]


class Row(NamedTuple):
    """Processor microseconds of the three planners, and by how many ticks ours ends later than pymapf's."""

    ours_us: list[float]
    plain_us: list[float]
    true_us: list[float]
    later_ticks: list[int]


def measure(site: CarPark, peer: Peer, busy: int, legs: int, queries: int, seed: int) -> tuple[Row, int]:
    """One row: random problems around the plans of ``busy`` others; also how many neither or only one could solve."""
    rng = random.Random(f"{seed} {busy} {legs}")
    row, unsolved = Row([], [], [], []), 0
    for _ in range(queries):
        fleet = Fleet(site, rng, DWELL_TICKS * TICK_US)
        myself, *others = rng.sample(list(fleet.ends), busy + 1)
        for node in others:
            start_us = rng.randrange(150) * TICK_US
            plan = fleet.query(node, start_us)
            if isinstance(plan, Route):
                fleet.take(node, start_us, plan)
        start, goals = fleet.ends[myself], [visit.segment for visit in fleet.task()][-legs:]
        visits = tuple(Visit(goal, 0) for goal in goals) if legs > 1 else ()
        before = time.process_time_ns()
        route = plan_route(site, fleet.reservations, myself, start, 0, visits, frozenset(goals[-1:]), MAX_EXPANSIONS)
        ours_us = (time.process_time_ns() - before) / 1000
        held = held_by_others(peer.grid, Departures(roads_of(site), fleet.reservations, myself, 0, {}))
        cells = [(goal.track, goal.index) for goal in goals]
        plain_tick, plain_us = peer.legs(held, (start.track, start.index), cells, true_distance=False)
        true_tick, true_us = peer.legs(held, (start.track, start.index), cells, true_distance=True)
        if plain_tick != true_tick:
            raise AssertionError(f"pymapf's own answers differ: {plain_tick}, {true_tick}")
        if plain_tick is None or not isinstance(route, Route):
            unsolved += 1
            continue
        row.ours_us.append(ours_us)
        row.plain_us.append(plain_us)
        row.true_us.append(true_us)
        row.later_ticks.append(_tick(route.legs[-1].end_us) - plain_tick if route.legs else -plain_tick)
    return row, unsolved


def figures_of(row: Row, unsolved: int) -> list[str]:
    """The figures of one row."""
    medians = [statistics.median(times) for times in (row.ours_us, row.plain_us, row.true_us)]
    ratios = [statistics.median(peer / ours for peer, ours in zip(times, row.ours_us, strict=True))
              for times in (row.plain_us, row.true_us)]  # fmt: skip
    ends = [sum(test(later) for later in row.later_ticks) for test in (_is_earlier, _is_equal, _is_later)]
    return [*(f"{one:.0f}" for one in medians), *(f"{one:.1f}" for one in ratios), *map(str, ends), str(unsolved)]


def _is_earlier(ticks: int) -> bool:
    return ticks < 0


def _is_equal(ticks: int) -> bool:
    return ticks == 0


def _is_later(ticks: int) -> bool:
    return ticks > 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--queries", type=int, default=100, help="queries in each row (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the random problems (default %(default)s)")
    options = parser.parse_args()
    print(f"seed {options.seed}, {options.queries} queries a row, 10 floors x 40, processor times in us, medians")
    heads = [
        "others",
        "legs",
        "ours",
        "pymapf",
        "true dist.",
        "ratio",
        "ratio true",
        "earlier",
        "equal",
        "later",
        "unsolved",
    ]
    site = grid_park(10, 40, 4)
    peer = Peer(GridOfSite(site))
    print("  ".join(f"{head:>10}" for head in heads))
    for busy in (0, 8):
        for legs in (1, 2):
            figures = figures_of(*measure(site, peer, busy, legs, options.queries, options.seed))
            print("  ".join(f"{cell:>10}" for cell in (str(busy), str(legs), *figures)))


if __name__ == "__main__":
    main()

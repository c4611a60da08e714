"""Time of one route query with two visits: on one alley, free and around reservations; on several floors with lifts.

    python bench/planning.py [--queries N] [--seed S]

Reservations are whole itineraries of other machines (run, work, run, gone) at random times of the next minutes, so each
is a set of windows as a mirror holds it. On several floors they are those of robots that were given tasks one after the
other within a minute, planned around each other by the same search and ending in refuges, as in a fleet at work. On
the shipped large site all eleven others have one.
Deterministic but for the times measured, which are those of the processor: other work does not count.
"""

import argparse
import random
import statistics
import time

from bus_sim.sites import find_site
from onboard.config.site import parse_site
from onboard.core.site import Segment
from onboard.io.collector import SOME, rare_looks
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.kinematics import run_duration_us
from onboard.ways.occupancy import standing_segments, travel_windows
from onboard.ways.refuges import refuges
from onboard.ways.reservations import Reservations, SlotWindow
from onboard.ways.sipp import Route, Visit, free_flow_us, plan_route
from tests.ways.fleets import SECOND, Fleet, park

#: Floors, positions on each, compartments, robots with a plan beside the one that asks.
FLEETS = ((3, 10, 2, 1), (5, 20, 3, 0), (5, 20, 3, 3), (10, 40, 4, 8))
#: Queries around the same plans of others.
QUERIES_A_FLEET = 10
SITE = """
[site]
name = "bench"
[floors]
count = 1
positions = {length}
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[robots]]
name = "MR1"
node = 11
home = "p(1,2)"
"""


def pass_by(site: CarPark, rng: random.Random) -> list[SlotWindow]:
    """Windows of a machine that comes, works for ten seconds and goes on, all within some minutes."""
    length = site.tracks[1].length
    here, begin_us = Segment(1, rng.randint(1, length)), rng.randrange(240) * SECOND
    windows: list[SlotWindow] = []
    for _ in range(2):
        there = rng.choice([index for index in range(1, length + 1) if index != here.index])
        run_us = run_duration_us(abs(there - here.index) * site.tracks[1].pitch_mm, site.carrier)
        windows += travel_windows(site, here, there, begin_us, begin_us + run_us)
        here, begin_us = Segment(1, there), begin_us + run_us
        windows += [SlotWindow(one, begin_us, begin_us + 10 * SECOND) for one in standing_segments(site, here)]
        begin_us += 10 * SECOND
    return windows


def measure(length: int, others: int, queries: int, seed: int) -> list[str]:
    """One row of the table."""
    rng = random.Random(f"{seed} {length} {others}")
    site = car_park(parse_site(SITE.format(length=length), "bench"))
    took_us: list[float] = []
    expansions: list[int] = []
    found = delayed = 0
    for _ in range(queries):
        reservations = Reservations()
        for node in range(20, 20 + others):
            reservations.reserve(node, pass_by(site, rng))
        free = [
            s for i in range(1, length + 1) if not reservations.safe_intervals(s := Segment(1, i), 11, 0)[0].from_us
        ]
        start = rng.choice(free)
        visits = tuple(Visit(Segment(1, rng.randint(1, length)), 10 * SECOND) for _ in range(2))
        before = time.process_time_ns()
        route = plan_route(site, reservations, 11, start, 0, visits, refuges(site), 4_000)
        took_us.append((time.process_time_ns() - before) / 1000)
        expansions.append(route.expansions)
        if isinstance(route, Route):
            found += 1
            delayed += route.finish_us > free_flow_us(site, start, 0, visits)
    took_us.sort()
    figures = (statistics.median(took_us), took_us[len(took_us) * 99 // 100], took_us[-1])
    row = [length, others, *(f"{figure:.0f}" for figure in figures)]
    return [str(cell) for cell in (*row, statistics.median(expansions), max(expansions), found, delayed)]


def measure_floors(site: CarPark, busy: int, queries: int, fleets: int, seed: int) -> list[str]:
    """One row of the second table: plans of one robot around the firm plans of ``busy`` others, of so many fleets."""
    rng = random.Random(f"{seed} {site.name} {len(site.places)} {busy}")
    took_us: list[float] = []
    expansions: list[int] = []
    pops: list[int] = []
    found = delayed = 0
    for _ in range(fleets):
        fleet = Fleet(site, rng)
        myself, *others = rng.sample(list(fleet.ends), busy + 1)
        fleet.busy(others)
        for _ in range(queries // fleets):
            before = time.process_time_ns()
            route = fleet.query(myself, 30 * SECOND)
            took_us.append((time.process_time_ns() - before) / 1000)
            pops.append(route.pops)
            expansions.append(route.expansions)
            found += isinstance(route, Route)
            delayed += fleet.delayed
    took_us.sort()
    figures = (statistics.median(took_us), took_us[len(took_us) * 99 // 100], took_us[-1])
    row = [busy, *(f"{figure:.0f}" for figure in figures)]
    cells = (*row, statistics.median(expansions), max(expansions), found, delayed, f"{statistics.mean(pops):.0f}")
    return [str(cell) for cell in cells]


def measure_bound(length: int, calls: int) -> float:
    """Microseconds of one free-flow bound with two visits."""
    site = car_park(parse_site(SITE.format(length=length), "bench"))
    visits = (Visit(Segment(1, 4), 10 * SECOND), Visit(Segment(1, length - 1), 10 * SECOND))
    free_flow_us(site, Segment(1, 2), 0, visits)
    before = time.process_time_ns()
    for start_us in range(calls):
        free_flow_us(site, Segment(1, 2), start_us, visits)
    return (time.process_time_ns() - before) / 1000 / calls


def tables(queries: int, seed: int) -> None:
    """Measure and print all rows."""
    heads = ["segments", "others", "median", "99 %", "most", "exp. median", "exp. most", "found", "delayed"]
    print("  ".join(f"{head:>11}" for head in heads))
    for length, others in ((20, 0), (40, 0), (20, 5), (40, 5), (40, 20)):
        print("  ".join(f"{cell:>11}" for cell in measure(length, others, queries, seed)))
    print()
    print("  ".join(f"{head:>11}" for head in ("floors", *heads[1:], "pops mean")))
    fleets = max(1, queries // QUERIES_A_FLEET)
    for floors, length, compartments, busy in FLEETS:
        row = measure_floors(park(floors, length, compartments), busy, queries, fleets, seed)
        print("  ".join(f"{cell:>11}" for cell in (f"{floors} x {length}", *row)))
    row = measure_floors(car_park(find_site("large")), 11, queries, fleets, seed)
    print("  ".join(f"{cell:>11}" for cell in ("large", *row)))
    print(f"free-flow bound, two visits: {measure_bound(40, 20_000):.1f} us")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--queries", type=int, default=1_000, help="queries in each row (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the random problems (default %(default)s)")
    options = parser.parse_args()
    print(f"seed {options.seed}, {options.queries} queries a row; processor times in us")
    # As in a robot's own process.
    with rare_looks(SOME, settled=True):
        tables(options.queries, options.seed)


if __name__ == "__main__":
    main()

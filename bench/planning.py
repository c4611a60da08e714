"""Time of one route query with two visits on an alley of 40 segments: free, and around 20 reservations.

    python bench/planning.py [--queries N] [--seed S]

Reservations are whole itineraries of other machines (run, work, run, gone) at random times of the next minutes, so each
is a set of windows as a mirror holds it. Deterministic but for the times measured.
"""

import argparse
import random
import statistics
import time

from onboard.config.site import parse_site
from onboard.core.kinematics import run_duration_us
from onboard.core.occupancy import standing_segments, travel_windows
from onboard.core.refuges import refuges
from onboard.core.reservations import Reservations, Window
from onboard.core.sipp import Route, Visit, free_flow_us, plan_route
from onboard.core.site import Segment, Site

SECOND = 1_000_000
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


def pass_by(site: Site, rng: random.Random) -> list[Window]:
    """Windows of a machine that comes, works for ten seconds and goes on, all within some minutes."""
    length = site.tracks[1].length
    here, begin_us = Segment(1, rng.randint(1, length)), rng.randrange(240) * SECOND
    windows: list[Window] = []
    for _ in range(2):
        there = rng.choice([index for index in range(1, length + 1) if index != here.index])
        run_us = run_duration_us(abs(there - here.index) * site.tracks[1].pitch_mm, site.carrier)
        windows += travel_windows(site, here, there, begin_us, begin_us + run_us)
        here, begin_us = Segment(1, there), begin_us + run_us
        windows += [Window(one, begin_us, begin_us + 10 * SECOND) for one in standing_segments(site, here)]
        begin_us += 10 * SECOND
    return windows


def measure(length: int, others: int, queries: int, seed: int) -> list[str]:
    """One row of the table."""
    rng = random.Random(f"{seed} {length} {others}")
    site = parse_site(SITE.format(length=length), "bench")
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
        before = time.perf_counter_ns()
        route = plan_route(site, reservations, 11, start, 0, visits, refuges(site), 4_000)
        took_us.append((time.perf_counter_ns() - before) / 1000)
        expansions.append(route.expansions)
        if isinstance(route, Route):
            found += 1
            delayed += route.finish_us > free_flow_us(site, start, 0, visits)
    took_us.sort()
    figures = (statistics.median(took_us), took_us[len(took_us) * 99 // 100], took_us[-1])
    row = [length, others, *(f"{figure:.0f}" for figure in figures)]
    return [str(cell) for cell in (*row, statistics.median(expansions), max(expansions), found, delayed)]


def measure_bound(length: int, calls: int) -> float:
    """Microseconds of one free-flow bound with two visits."""
    site = parse_site(SITE.format(length=length), "bench")
    visits = (Visit(Segment(1, 4), 10 * SECOND), Visit(Segment(1, length - 1), 10 * SECOND))
    free_flow_us(site, Segment(1, 2), 0, visits)
    before = time.perf_counter_ns()
    for start_us in range(calls):
        free_flow_us(site, Segment(1, 2), start_us, visits)
    return (time.perf_counter_ns() - before) / 1000 / calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--queries", type=int, default=1_000, help="queries in each row (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the random problems (default %(default)s)")
    options = parser.parse_args()
    print(f"seed {options.seed}, {options.queries} queries a row; times in us")
    heads = ["segments", "others", "median", "99 %", "most", "exp. median", "exp. most", "found", "delayed"]
    print("  ".join(f"{head:>11}" for head in heads))
    for length, others in ((20, 0), (40, 0), (20, 5), (40, 5), (40, 20)):
        print("  ".join(f"{cell:>11}" for cell in measure(length, others, options.queries, options.seed)))
    print(f"free-flow bound, two visits: {measure_bound(40, 20_000):.1f} us")


if __name__ == "__main__":
    main()

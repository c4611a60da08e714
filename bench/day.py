"""How fast real days run: simulated seconds a second, frames a second, with all controllers and exact frame times.

Run: ``python bench/day.py [SESSIONS.csv DAY]``; with a file of sessions, that day on the standard site is one more row.
Wall times are this machine's; the ratio of two rows of one site is the cost of the log.
"""

import tempfile
from pathlib import Path

from bench._arguments import given
from bus_sim.options import RunOptions
from bus_sim.session import run_site
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from bus_sim.systems.car_park.summary import RunSummary


def row(name: str, site: str, options: RunOptions) -> RunSummary:
    """Play and print one row; the hour of a window is measured without its warm-up."""
    summary = run_site(find_site(site), options)
    assert isinstance(summary, RunSummary)
    wall_s, simulated_s, frames = summary.wall_s, summary.simulated_s, summary.frames
    served = f"{summary.cars_in}/{summary.cars_out}"
    speed = f"{simulated_s / wall_s:,.0f}"
    print(f"| {name} | {served} | {wall_s:.1f} | {speed} | {frames:,} | {frames / wall_s:,.0f} |", flush=True)
    return summary


def main() -> None:
    """Print a row for each shipped site: how many times faster than real time its day is played."""
    words = given(sessions=(Path, ""), day=(str, ""))
    print("| what runs | cars in/out | wall s | times real time | fleet frames | fleet frames/s |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.log"
        row("level1, its real day, no log", "level1", RunOptions(demand=ParkingDay(), quiet=True))
        row(
            "level1, all buses logged", "level1", RunOptions(demand=ParkingDay(), trace=trace, devices=True, quiet=True)
        )
        row("standard, the real day, no log", "standard", RunOptions(demand=ParkingDay(), quiet=True))
        row(
            "standard, all buses logged",
            "standard",
            RunOptions(demand=ParkingDay(), trace=trace, devices=True, quiet=True),
        )
        row(
            "standard, its busiest hour, no log",
            "standard",
            RunOptions(demand=ParkingDay(window="busiest"), quiet=True),
        )
        if words.day:
            sessions, day = words.sessions, words.day
            row(
                f"standard, {day}, no log",
                "standard",
                RunOptions(demand=ParkingDay(sessions=sessions, day=day), quiet=True),
            )


if __name__ == "__main__":
    main()

"""What the choice of places costs those who fetch their cars in the evening, on working days of a table of sessions.

Run: ``python bench/places.py SESSIONS.csv [--site standard] [--days 20] [--policies nearest,cost,...] [--keep FILE]``.
A policy is a word of ``[negotiation] place``; with ``+moves`` cars are brought nearer in quiet hours as well, with
``+announced`` so and all customers say with their tickets when they will come, off by ``SIGMA_S``. The days
are fixed by the table alone: so many working days, drawn by ``random.Random("evening peaks")``, and played in the order
drawn, so that fewer of them are the first of the same. The evening peak is 15:00 to 19:00: who asks for a car then
counts, from the ticket to driving out, and the metres of all robots in these hours, by customer who came or went. Each
day begins empty and without anything learned, seed 1. ``--keep`` appends each play to a CSV file and goes on from what
is there. A day takes 40 to 60 s of processor time under each policy.
"""

import argparse
import csv
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bus_sim.sites import find_site
from bus_sim.systems.car_park.compare.plays import MIP, play
from bus_sim.systems.car_park.demand import WHOLE_DAY, Announcements, Demand
from bus_sim.systems.car_park.design.days import DayPlan, by_day, played
from bus_sim.systems.car_park.window import HOUR_US, DayWindow
from onboard.systems.car_park.site import CarPark, PlacePolicy, car_park

DAYS, DRAWN_BY = 20, "evening peaks"
PEAK = DayWindow(15 * HOUR_US, 19 * HOUR_US)
MOVES, ANNOUNCED = "moves", "announced"
#: What people say beforehand is off by so much, s, in standard deviation.
SIGMA_S = 600.0
BASE = "nearest"
COLUMNS = (
    "place",
    "days",
    "out",
    "mean out, s",
    "to nearest",
    "days better",
    "mean in, s",
    "metres a customer",
    "loaded",
    "empty",
    "not served, faults",
)
POLICIES = (BASE, "cost", "stay", "balanced", "random", "nearest+moves", "cost+moves", "nearest+announced")


class Evening(NamedTuple):
    """One play: who came and went in the peak, their waiting in s, and the robots' metres, loaded and empty."""

    day: str
    policy: str
    ins: int
    in_s: float
    outs: int
    out_s: float
    loaded_m: float
    empty_m: float
    left: int
    faults: int


def drawn(path: Path | None, site: CarPark, count: int) -> list[DayPlan]:
    """The days, in the order drawn."""
    plans = by_day(Demand.from_sessions(path, park=site, shipped=WHOLE_DAY))
    numbers = random.Random(DRAWN_BY).sample(range(len(plans)), min(DAYS, len(plans)))[:count]
    return [plans[number]._replace(demand=played(plans[number].demand, site)) for number in numbers]


def asked_for(site: CarPark, policy: str) -> CarPark:
    """The site with a policy's words."""
    place, _, word = policy.partition("+")
    return replace(site, place=PlacePolicy(place), quiet_moves=word in (MOVES, ANNOUNCED))


def evening(site: CarPark, policy: str, day: DayPlan) -> Evening:
    """Play one day up to the end of its peak."""
    is_said = policy.endswith(f"+{ANNOUNCED}")
    demand = Announcements(1.0, SIGMA_S).of(day.demand, day.seed) if is_said else day.demand
    found = play(asked_for(site, policy), demand, MIP, day.seed, PEAK)
    ins, outs = len(found.in_us), len(found.out_us)
    in_s, out_s = sum(found.in_us) / max(1, ins) / 1e6, sum(found.out_us) / max(1, outs) / 1e6
    loaded_mm = found.travel_mm - found.empty_mm
    metres = loaded_mm / 1000, found.empty_mm / 1000
    return Evening(day.label, policy, ins, in_s, outs, out_s, *metres, found.left, len(found.faults))


def kept(path: Path | None) -> list[Evening]:
    """Plays of an earlier run, in their order; none without a file."""
    if path is None or not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    kinds = Evening.__annotations__.values()
    return [Evening(*(kind(cell) for kind, cell in zip(kinds, row, strict=True))) for row in rows]


def keep(path: Path | None, one: Evening) -> None:
    """Append one play, so that a run that is stopped can go on."""
    if path is not None:
        with path.open("a", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow(one)


def row(policy: str, plays: Sequence[Evening], base: Sequence[Evening]) -> str:
    """One line of the table: all customers of a policy's days together, beside ``nearest`` on the same days."""
    out_s, people = _mean_s(plays), sum(one.ins + one.outs for one in plays)
    same = [one for one in base if one.day in {play.day for play in plays}]
    change = f"{out_s / _mean_s(same) - 1:+.1%}" if len(same) == len(plays) else "-"
    by_day = {one.day: one.out_s for one in same}
    better = sum(one.out_s < by_day.get(one.day, 0) for one in plays)
    in_s = sum(one.ins * one.in_s for one in plays) / max(1, sum(one.ins for one in plays))
    loaded_m, empty_m = sum(one.loaded_m for one in plays) / people, sum(one.empty_m for one in plays) / people
    wrong = sum(one.left + one.faults for one in plays)
    outs = sum(one.outs for one in plays)
    return (
        f"| {policy} | {len(plays)} | {outs} | {out_s:.1f} | {change} | {better} | {in_s:.1f} "
        f"| {loaded_m + empty_m:.1f} | {loaded_m:.1f} | {empty_m:.1f} | {wrong} |"
    )


def _mean_s(plays: Sequence[Evening]) -> float:
    return sum(one.outs * one.out_s for one in plays) / sum(one.outs for one in plays)


def main() -> None:
    """Play day by day, each policy, and print a row for each policy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sessions", nargs="?", type=Path)
    parser.add_argument("--site", default="standard")
    parser.add_argument("--days", type=int, default=DAYS)
    parser.add_argument("--policies", default=",".join(POLICIES))
    parser.add_argument("--keep", type=Path)
    args = parser.parse_args()
    site, policies = car_park(find_site(args.site)), args.policies.split(",")
    days = drawn(args.sessions, site, args.days)
    plays = kept(args.keep)
    for day in days:
        for policy in policies:
            if any((one.day, one.policy) == (day.label, policy) for one in plays):
                continue
            plays.append(evening(site, policy, day))
            keep(args.keep, plays[-1])
            print(f"{day.label} {policy}: out {plays[-1].out_s:.1f} s of {plays[-1].outs}", flush=True)
    print(f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|")
    labels = {day.label for day in days}
    for policy in policies:
        mine = [one for one in plays if one.policy == policy and one.day in labels]
        print(row(policy, mine, [one for one in plays if one.policy == BASE and one.day in labels]))


if __name__ == "__main__":
    main()

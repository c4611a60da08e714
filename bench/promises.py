"""How promises to customers are kept over the months of a table of sessions: all, in the busiest minutes, how wide.

Run: ``python bench/promises.py [SESSIONS.csv [SITE [DAYS [OUT.csv]]]]``: of each month the first DAYS (10) working days
in one run of SITE (``small``); without a table the shipped day. Each begins an hour after the last car of the one
before has left: nights are left out, as nobody asks then, and so is who stays past four in the next morning;
compartments go on with what they learned. ``OUT.csv`` gets a row for each customer. A day takes most of a minute of
processor time.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path
from statistics import median
from typing import NamedTuple

from bench._arguments import a_count, a_site, given
from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import WHOLE_DAY, Demand, Stay
from bus_sim.systems.car_park.design.days import FETCHED_UNTIL_US, SATURDAY
from bus_sim.systems.car_park.promised import PromiseSeen, busiest_minutes, seen_of, share_kept, waits_width_s
from bus_sim.systems.car_park.sizes import broken_limits
from bus_sim.systems.car_park.stage import CarParkStage
from bus_sim.systems.car_park.window import DAY_US, HOUR_US
from onboard.systems.car_park.site import CarPark, car_park

DAYS = 10
#: Of fewer customers in a day no width of a central 90 % is told.
FEWEST = 10


class PlayedDay(NamedTuple):
    """A day and its stays, in us after its midnight."""

    day: date
    stays: tuple[Stay, ...]


@dataclass(frozen=True)
class DaysInOne:
    """Days one behind the other, without the nights between."""

    days: tuple[PlayedDay, ...]

    def demand(self, seed: int) -> Demand:
        """All stays, the first of which comes at time zero."""
        return Demand(tuple(stay for _, stay in self.stays()))

    def stays(self) -> Iterator[tuple[date, Stay]]:
        """Each with the day that it is of."""
        begins_us = 0
        for day, stays in self.days:
            shift_us = begins_us - min(stay.arrival_us for stay in stays)
            leaves_us = [stay.departure_us + shift_us for stay in stays if stay.departure_us is not None]
            for stay in stays:
                departure_us = None if stay.departure_us is None else stay.departure_us + shift_us
                yield day, replace(stay, arrival_us=stay.arrival_us + shift_us, departure_us=departure_us)
            begins_us = max(leaves_us) + HOUR_US


def working_days(path: Path | None, site: CarPark, count: int) -> tuple[tuple[PlayedDay, ...], int]:
    """The first so many of each month, and how many of their stays are left out."""
    whole = Demand.from_sessions(path, park=site, shipped=WHOLE_DAY)
    assert whole.zero is not None
    by_day: dict[date, list[Stay]] = {}
    for stay in whole.stays:
        number = stay.arrival_us // DAY_US
        day = (whole.zero + timedelta(days=number)).date()
        shifted = replace(stay, arrival_us=stay.arrival_us - number * DAY_US)
        if day.weekday() < SATURDAY:
            leaves_us = None if stay.departure_us is None else stay.departure_us - number * DAY_US
            by_day.setdefault(day, []).append(replace(shifted, departure_us=leaves_us))
    months: dict[tuple[int, int], list[date]] = {}
    for day in sorted(by_day):
        months.setdefault((day.year, day.month), []).append(day)
    chosen = [day for days in months.values() for day in days[:count]]
    played = tuple(PlayedDay(day, tuple(one for one in by_day[day] if _is_played(one, site))) for day in chosen)
    return played, sum(len(by_day[day]) for day in chosen) - sum(len(one.stays) for one in played)


def _is_played(stay: Stay, site: CarPark) -> bool:
    is_fetched = stay.departure_us is not None and stay.departure_us < DAY_US + FETCHED_UNTIL_US
    return is_fetched and not broken_limits(stay.car, site)


def row(name: str, days: Sequence[Sequence[PromiseSeen]]) -> str:
    """One line of the table: some days together."""
    every = [one for day in days for one in day]
    busiest = [one for day in days for one in busiest_minutes(day)]
    widths_s = [2 * one.spread_us / 1e6 for one in every]
    ratios = sorted(
        median(2 * one.spread_us / 1e6 for one in day) / waits_width_s(day) for day in days if len(day) >= FEWEST
    )
    share = f"{median(ratios):.1%} ({ratios[-1]:.1%})" if ratios else "-"
    waits_s = f"{median(waits_width_s(day) for day in days):.0f}"
    return (
        f"| {name} | {len(days)} | {len(every)} | {share_kept(every):.1%} "
        f"| {share_kept(busiest):.1%} of {len(busiest)} | {median(widths_s):.1f} | {waits_s} | {share} |"
    )


def main() -> None:
    """Print a row for each month, and one for all."""
    words = given(sessions=(str, ""), site=(a_site, "small"), days=(a_count, DAYS), out=(str, ""))
    name = words.site
    site = replace(car_park(find_site(name)), promises=True)
    days, left_out = working_days(Path(words.sessions) if words.sessions else None, site, words.days)
    demand = DaysInOne(days)
    stage = play(site, RunOptions(demand=demand, quiet=True))
    assert isinstance(stage, CarParkStage)
    seen: dict[date, list[PromiseSeen]] = {one.day: [] for one in days}
    for (day, _), customer in zip(demand.stays(), stage.customers, strict=True):
        seen[day] += seen_of([customer.visit])
    seen = {day: sorted(one) for day, one in seen.items()}
    every = list(seen.values())
    asked = sum(customer.visit.asked_us is not None for customer in stage.customers)
    print(
        f"{name}: {len(days)} days, {asked} asked, {sum(map(len, every))} promised and come, {left_out} stays left out"
    )
    print(
        "| what | days | customers | kept | in the busiest 5 min | width, median s | central 90 % of waits, s "
        "| share, median of days (most) |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for month in dict.fromkeys((day.year, day.month) for day in seen):
        print(row(f"{month[0]}-{month[1]:02d}", [one for day, one in seen.items() if (day.year, day.month) == month]))
    print(row("all", every))
    if words.out:
        with Path(words.out).open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file)
            table.writerow(["day", *PromiseSeen._fields])
            table.writerows((day, *one) for day, found in seen.items() for one in found)


if __name__ == "__main__":
    main()

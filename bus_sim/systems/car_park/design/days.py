"""The days that a design is judged by: working days of a table, or one day with other people."""

import random
from argparse import Namespace
from dataclasses import replace
from datetime import datetime, timedelta
from typing import NamedTuple

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.day import ParkingDay, asked_inside, brought_in, check_together, choose_demand
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.mapping import table_form
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.sizes import broken_limits
from bus_sim.systems.car_park.window import DAY_US, HOUR_US
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.site import CarPark

#: Who stays so long after midnight is not fetched in a run of the day before, us: a run would last days for one car.
FETCHED_UNTIL_US = 4 * HOUR_US
#: Days of this week day number on are no working days.
SATURDAY = 5
#: Overload: a compartment serves some 70 cars an hour in and out; so far apart cars come for each, s.
OVERLOAD_S = 45.0
OVERLOAD_CARS = 60
#: Cars that fill a park come so far apart, us: nobody waits for them, and no two come at once.
FILL_US = 1_000_000


class DayPlan(NamedTuple):
    """One day to be judged by: who comes, and the seed of what people do."""

    label: str
    demand: Demand
    seed: int


class Days(NamedTuple):
    """Days to search by, days that the search has not seen, and lines for who asked."""

    seen: list[DayPlan]
    unseen: list[DayPlan]
    remarks: list[str]


def days_of(args: Namespace, site: CarPark) -> Days:
    """``args.days`` days to search by and ``args.unseen`` others; as seeds where there is one day. ``DemandError``."""
    check_together(args)
    inside, overnight = asked_inside(args)
    day = ParkingDay(args.sessions, args.counts, table_form(args), inside, overnight, args.day)
    whole = choose_demand(day, site)
    remarks = list(whole.remarks)
    plans = by_day(whole)
    if len(plans) < 2:
        found = [
            DayPlan(f"seed {seed}", played(choose_demand(day, site, seed), site), seed)
            for seed in range(1, args.days + args.unseen + 1)
        ]
        return Days(found[: args.days], found[args.days :], remarks)
    if len(plans) < 1 + args.unseen:
        raise DemandError(
            f"--unseen {args.unseen}: the table has {len(plans)} working days; ask for fewer, or give more"
        )
    wanted = min(args.days, len(plans) - args.unseen)
    if wanted < args.days:
        remarks.append(
            f"searched by {wanted} working days: the table has {len(plans)}, and {args.unseen} are kept back"
        )
    # Spread over the table, and drawn so that both kinds are of all seasons.
    chosen = random.Random("design days").sample(range(len(plans)), wanted + args.unseen)
    found = [plans[number]._replace(demand=played(plans[number].demand, site)) for number in chosen]
    by_date = sorted(found[:wanted], key=lambda one: one.label), sorted(found[wanted:], key=lambda one: one.label)
    return Days(*by_date, remarks)


def by_day(demand: Demand) -> list[DayPlan]:
    """Each working day of a demand by itself; all days where there is no working day."""
    if demand.zero is None:
        return []
    stays: dict[int, list[Stay]] = {}
    for stay in demand.stays:
        number = stay.arrival_us // DAY_US
        stays.setdefault(number, []).append(_shifted(stay, number * DAY_US))
    plans = [_plan_of(demand.zero + timedelta(days=number), found) for number, found in sorted(stays.items())]
    working = [plan for plan, zero in plans if zero.weekday() < SATURDAY]
    return working or [plan for plan, _ in plans]


def _plan_of(zero: datetime, stays: list[Stay]) -> tuple[DayPlan, datetime]:
    return DayPlan(f"{zero:%Y-%m-%d}", Demand(tuple(stays), zero), 1), zero


def _shifted(stay: Stay, by_us: int) -> Stay:
    leaves_us = None if stay.departure_us is None else stay.departure_us - by_us
    is_fetched = leaves_us is not None and leaves_us < DAY_US + FETCHED_UNTIL_US
    return replace(stay, arrival_us=stay.arrival_us - by_us, departure_us=leaves_us if is_fetched else None)


def played(demand: Demand, site: CarPark) -> Demand:
    """Without cars that the gate refuses: they wait for nothing. Those inside at the start come before."""
    fitting = tuple(stay for stay in demand.stays if not broken_limits(stay.car, site))
    return brought_in(replace(demand, stays=fitting), site)


def overload(site: CarPark, seed: int) -> DayPlan:
    """So many cars come and go that somebody always waits: what the machines can do at most."""
    mean_s = OVERLOAD_S / max(1, len(site.compartments))
    count = min(OVERLOAD_CARS, len(site.places))
    demand = Demand.by_mean(mean_s, mean_s / 3, seed, count=count)
    return DayPlan(f"overload {seed}", demand, seed)


def fill_and_empty(site: CarPark, leave_us: int | None, seed: int = 1) -> DayPlan:
    """A car for each place that is used, one by one; all are fetched at ``leave_us``, none where it is None."""
    used = len(to_fetch_from(site, site.places))
    cars = (random_car(f"car {number}", seed) for number in range(1, 4 * used))
    fitting = [car for car in cars if not broken_limits(car, site)][:used]
    # Nobody keeps the order of those who ask in one moment.
    stays = tuple(
        Stay(number * FILL_US, None if leave_us is None else leave_us + number * FILL_US, car)
        for number, car in enumerate(fitting)
    )
    return DayPlan("fill and empty", Demand(stays), seed)

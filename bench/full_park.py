"""A large car park that is nearly full: cars an hour, ticket to car ready, and how fast it fills and empties.

    python -m bench.full_park [SITE] [--share 80] [--seed 1] [--only busy,calm,in,out,day] [--fast] [--hours 2]

The power comes on with so many places taken (``standing_cars``). Each part then goes on from that very state, in a
process of its own that is forked off, one after the other:

- ``busy``: cars come and are fetched at normal intervals, ``--busy`` an hour in and out together, for ``--hours`` after
  ten minutes that are not counted;
- ``calm``: the same at ``--calm`` an hour;
- ``in``: cars come one a second until the last place is taken, or ``--hours`` are over;
- ``out``: all cars are asked for, one a second;
- ``day``: ``--operations`` cars in and out, evenly over 24 hours: how many times faster than real time that is played.

Any car that has been inside for five minutes is as likely to be fetched next. ``--fast`` puts the drives of ``FAST``
into the site file. Wall times are this machine's, beside whatever else it does; processor times are the part's own.
"""

import argparse
import asyncio
import os
import random
import sys
import time
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass

from rich.console import Console

from bus_sim.demand import Law
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import site_text
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.bodies import CarBody, random_car
from bus_sim.systems.car_park.plant.customer import Customer, CustomerState
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.systems.car_park.sizes import broken_limits
from bus_sim.systems.car_park.stage import CarParkStage, ComingCustomers
from bus_sim.systems.car_park.standing_cars import stand
from bus_sim.systems.car_park.summary import RunSummary
from bus_sim.systems.stage import EndedRun
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.config.site import parse_site
from onboard.systems.car_park.site import CarPark, car_park

#: Faster drives than those of the site file, as published of such machines: carriers of 125 m/min.
FAST = "\n[carrier]\nspeed_mm_s = 2_080\n\n[shuttle]\nspeed_mm_s = 1_500\n\n[lift]\nspeed_mm_s = 1_500\n"
SECOND_US, HOUR_US = 1_000_000, 3_600_000_000
#: Nobody comes in the first minute: the machines tell each other what they know.
POWER_UP_US = 60 * SECOND_US
#: A long part tells how it stands every half hour of its own time.
TOLD_US = 1_800 * SECOND_US
#: A part is not counted in its first minutes.
LEAD_US = 600 * SECOND_US
#: A car stays so long before it may be fetched.
LEAST_STAY_US = 300 * SECOND_US
PARTS = ("busy", "calm", "in", "out", "day")


@dataclass
class Park:
    """A run that goes on, and its customers."""

    site: CarPark
    seed: int
    loop: VirtualTimeLoop
    run: Simulation
    stage: CarParkStage
    number: int = 0

    @property
    def now_us(self) -> int:
        """Time of the run's loop, us since power-up."""
        return self.loop.now_us()

    def bring(self, at_us: int) -> Customer:
        """A customer with a car that the site takes."""
        return self.stage.plant.street.add(Stay(at_us, None, self.car()))

    def car(self) -> CarBody:
        """A car that the site takes."""
        while True:
            self.number += 1
            car = random_car(f"car {self.number}", self.seed)
            if not broken_limits(car, self.site):
                return car

    def parked(self) -> list[Customer]:
        """Whose car stands inside and was not asked for."""
        return [one for one in self.stage.customers if one.state is CustomerState.PARKED and not one.is_leaving]

    def fetch_one(self, chance: random.Random) -> None:
        """Somebody whose car has been inside for long enough comes for it."""
        until_us = self.now_us - LEAST_STAY_US
        found = [one for one in self.parked() if (one.visit.parked_us or 0) <= until_us]
        if found:
            chance.choice(found).leave_now()

    def turn_over(self, per_hour: float, span_us: int) -> None:
        """Cars come, and are fetched, half of ``per_hour`` each, from now on."""
        law = Law(7_200 / per_hour, 2_400 / per_hour)
        for at_us in _times(law, f"in:{self.seed}", span_us):
            self.bring(self.now_us + at_us)
        chance = random.Random(f"who:{self.seed}")
        for at_us in _times(law, f"out:{self.seed}", span_us):
            self.stage.plant.timers.call_at(self.now_us + at_us, lambda: self.fetch_one(chance))

    async def until(self, done: Callable[[], bool], limit_us: int) -> bool:
        """Play on until ``done``, looked at each second; False where ``limit_us`` of loop time came first."""
        return await run_until(self.run, done, limit_us, SECOND_US)

    async def pass_us(self, span_us: int) -> None:
        """Let so much time pass."""
        await self.until(lambda: False, self.now_us + span_us)

    def waiting(self) -> int:
        """Customers who wait for anything."""
        still = (CustomerState.COMING, CustomerState.PARKED, CustomerState.GONE)
        return sum(one.state not in still for one in self.stage.customers)

    def summary(self, begin_us: int, wall_s: float) -> RunSummary:
        """What came of it since then."""
        return self.stage.summary(EndedRun(wall_s, begin_us))


def _times(law: Law, seed: str, span_us: int) -> Iterator[int]:
    chance, at_us = random.Random(seed), 0
    while (at_us := at_us + law.draw_us(chance)) < span_us:
        yield at_us


def _say(*lines: str) -> None:
    print("\n".join(lines), flush=True)


async def turn_over(park: Park, what: str, per_hour: float, hours: float) -> None:
    """A steady rate, counted after its first minutes."""
    wall_s, cpu_s = time.monotonic(), time.process_time()
    span_us = LEAD_US + round(hours * HOUR_US)
    park.turn_over(per_hour, span_us)
    await park.pass_us(LEAD_US)
    park.stage.measure_from(park.now_us)
    begin_us, before = park.now_us, park.waiting()
    while (left_us := begin_us + span_us - LEAD_US - park.now_us) > 0:
        await park.pass_us(min(left_us, TOLD_US))
        so_far = park.stage.plant.street.summary(begin_us)
        hours_so_far = (park.now_us - begin_us) / HOUR_US
        _say(f"{what}: {hours_so_far:.1f} h: in {so_far.parked}, out {so_far.served}, waiting {park.waiting()}")
    found = park.summary(begin_us, time.monotonic() - wall_s)
    through = (found.cars_in + found.cars_out) / hours
    cpu_s = time.process_time() - cpu_s
    _say(
        f"{what}: {per_hour:g} an hour asked for, {through:.1f} an hour through in {hours:g} h; "
        f"waiting {before} at its begin, {found.unserved} at its end; wall {time.monotonic() - wall_s:.0f} s, "
        f"processor {cpu_s:.0f} s: {span_us / 1e6 / cpu_s:.0f} times real time",
        *found.lines(),
    )


async def one_way(park: Park, what: str, hours: float) -> None:
    """All free places are filled, or all cars fetched, as fast as it goes."""
    wall_s, cpu_s, begin_us = time.monotonic(), time.process_time(), park.now_us
    park.stage.measure_from(begin_us)
    if what == "in":
        moved = [park.bring(begin_us + at * SECOND_US) for at in range(len(park.site.places) - len(park.parked()))]
    else:
        moved = random.Random(f"out:{park.seed}").sample(park.parked(), len(park.parked()))
        for at, one in enumerate(moved):
            park.stage.plant.timers.call_at(begin_us + at * SECOND_US, one.leave_now)
    end = CustomerState.PARKED if what == "in" else CustomerState.GONE
    limit_us, next_us = begin_us + round(hours * HOUR_US), begin_us
    while next_us < limit_us and any(one.state is not end for one in moved):
        next_us = min(next_us + TOLD_US, limit_us)
        await park.until(lambda: all(one.state is end for one in moved), next_us)
        done, cpu_so_far_s = sum(one.state is end for one in moved), time.process_time() - cpu_s
        _say(f"{what}: {(park.now_us - begin_us) / HOUR_US:.1f} h: {done} cars; processor {cpu_so_far_s:.0f} s")
    found, passed = park.summary(begin_us, time.monotonic() - wall_s), (park.now_us - begin_us) / HOUR_US
    through = found.cars_in + found.cars_out
    _say(
        f"{what}: {through} of {len(moved)} cars in {passed:.2f} h, {through / passed:.0f} an hour; "
        f"processor {time.process_time() - cpu_s:.0f} s",
        *found.lines(),
    )


async def begin(park: Park, share: float) -> None:
    """Power on with so many places taken."""
    cpu_s, count = time.process_time(), round(len(park.site.places) * share)
    stand(park.run, [Stay(0, None, park.car()) for _ in range(count)])
    park.stage.listen()
    park.stage.show(Console(quiet=True))
    park.run.start()
    await park.pass_us(POWER_UP_US)
    load = park.run.fleet.statistics()
    _say(
        f"{park.site.name}: {len(park.site.machines)} machines, {count} of {len(park.site.places)} places taken; on in "
        f"{time.process_time() - cpu_s:.0f} s of processor time, worst second {load.worst_second_load:.1%} of the bus"
    )


def play(park: Park, args: argparse.Namespace) -> None:
    """Power on, then each part in a process of its own."""
    park.loop.run_until_complete(begin(park, args.share / 100))
    parts: dict[str, Callable[[], Coroutine[None, None, None]]] = {
        "busy": lambda: turn_over(park, "busy", args.busy, args.hours),
        "calm": lambda: turn_over(park, "calm", args.calm, args.hours),
        "in": lambda: one_way(park, "in", args.hours),
        "out": lambda: one_way(park, "out", args.hours),
        "day": lambda: turn_over(park, "day", args.operations / 24, args.day_hours),
    }
    for name in args.only:
        child = os.fork()
        if child:
            os.waitpid(child, 0)
            continue
        # Whatever is raised ends the child as it would any process.
        park.loop.run_until_complete(parts[name]())
        sys.stdout.flush()
        os._exit(0)


def main() -> None:
    """Play what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("site", nargs="?", default="harbour")
    parser.add_argument(
        "--share", type=float, default=80.0, help="places taken at first, per cent (default %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(PARTS), help="parts, in this order (default %(default)s)")
    parser.add_argument("--fast", action="store_true", help="with the faster drives")
    parser.add_argument("--busy", type=float, default=235.0, metavar="CARS", help="an hour (default %(default)s)")
    parser.add_argument("--calm", type=float, default=100.0, metavar="CARS", help="an hour (default %(default)s)")
    parser.add_argument("--hours", type=float, default=2.0, help="of busy and calm (default %(default)s)")
    parser.add_argument("--operations", type=float, default=2_000.0, help="of the day (default %(default)s)")
    parser.add_argument("--day-hours", type=float, default=23.75, help="counted hours of the day (default %(default)s)")
    args = parser.parse_args()
    if not 0 <= args.share <= 100:
        parser.error(f"--share {args.share:g}: write 0 to 100 per cent")
    args.only = [name for name in args.only.split(",") if name in PARTS]
    text = site_text(args.site) + (FAST if args.fast else "")
    site = car_park(parse_site(text, f"{args.site}.toml"))
    loop = VirtualTimeLoop()
    try:
        asyncio.set_event_loop(loop)
        simulation = build(site, RunOptions(seed=args.seed, quiet=True), loop)
        park = Park(site, args.seed, loop, simulation, CarParkStage(simulation, ComingCustomers(Demand(()))))
        play(park, args)
    finally:
        asyncio.set_event_loop(None)
        loop.close()


if __name__ == "__main__":
    main()

"""How lifts are shared: planned on the mirror, asked before the bid, or locked for a session; on the same arrivals.

Run: ``python bench/lift_modes.py [SITE] [CARS] [SEEDS]``, by default 12 cars on ``standard``, 5 seeds. (On a site with
one compartment robots do not meet at lifts.) Virtual time: the figures are the same on every machine.
"""

import asyncio
import dataclasses
import statistics
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from bench._arguments import a_count, a_site, given
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.baselines import session_lock
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import CallResult, KindCode
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, Message, TaskReport
from onboard.core.behaviour import BehaviourFactory
from onboard.core.site import Site
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.systems.registry import factory_for
from onboard.wire.codec import fleet_codec

#: Customers come this long after power-up, us.
ORIGIN_US = 10_000_000
#: A run that takes longer has got stuck, us.
LIMIT_US = 4 * 3_600_000_000
#: Cars come, and are fetched, at these intervals: mean and deviation in s. Dense enough that robots meet at lifts.
INTERVAL_S = (45.0, 20.0)
NEGOTIATION = (CallForProposals, Bid, Award, Itinerary, TaskReport)


class Mode(NamedTuple):
    """One way to share lifts."""

    name: str
    rides: RideCalls
    factories: Callable[[Site, KindCode], BehaviourFactory]


MODES = (
    Mode("planned on the mirror, told by the itinerary", RideCalls.PLANNED, factory_for),
    Mode("called before the bid, as options", RideCalls.BEFORE, factory_for),
    Mode("session lock, from call to leaving", RideCalls.PLANNED, session_lock.factories),
)


@dataclass
class Count:
    """What is counted on the fleet bus of one run, and what its customers waited."""

    frames: int = 0
    ride_calls: int = 0
    calls_us: dict[tuple[int, int], int] = field(default_factory=dict)
    bids_us: dict[tuple[int, int, int], int] = field(default_factory=dict)
    latency_us: list[int] = field(default_factory=list)
    tasks: int = 0
    in_us: list[int] = field(default_factory=list)
    out_us: list[int] = field(default_factory=list)

    def hear(self, message: Message, time_us: int) -> None:
        """One message of the fleet bus."""
        if isinstance(message, NEGOTIATION):
            self.frames += len(fleet_codec().encode(message))
        match message:
            case CallForProposals(depth=0):
                self.calls_us[message.sender, message.call] = time_us
            case CallForProposals():
                self.ride_calls += 1
            case Bid():
                self.bids_us[message.initiator, message.call, message.sender] = time_us
            case Award(result=CallResult.AWARDED) if (message.sender, message.call) in self.calls_us:
                called_us = self.calls_us.pop((message.sender, message.call))
                self.latency_us.append(self.bids_us[message.sender, message.call, message.winner] - called_us)

    def take(self, simulation: Simulation) -> None:
        """Add up the customers' part at the end of a run. Raises ``RuntimeError`` where somebody still waits."""
        street = simulation.plant.street
        summary = street.summary()
        broken = simulation.plant.oracle.finish()
        if not street.is_over or broken:
            raise RuntimeError(f"the run did not end well: {summary}, {broken}")
        self.tasks += summary.parked + summary.served
        self.in_us += summary.in_wait_us
        self.out_us += summary.out_wait_us


async def _play(site: Site, mode: Mode, demand: Demand, seed: int, loop: VirtualTimeLoop, count: Count) -> None:
    simulation = build(site, RunOptions(seed=seed), loop)
    simulation.factories = mode.factories
    simulation.observers.append(count.hear)
    simulation.plant.street.add_all(demand, ORIGIN_US)
    simulation.start()
    await run_until(simulation, lambda: simulation.plant.street.is_over, LIMIT_US, 1_000_000)
    await asyncio.sleep(60)
    count.take(simulation)


def measure(site: Site, mode: Mode, cars: int, seeds: range) -> Count:
    """One mode on a site, over all seeds."""
    count = Count()
    site = dataclasses.replace(car_park(site), rides=mode.rides)
    for seed in seeds:
        demand = Demand.by_mean(*INTERVAL_S, seed, count=cars)
        loop = VirtualTimeLoop()
        try:
            loop.run_until_complete(_play(site, mode, demand, seed, loop, count))
        finally:
            loop.close()
    return count


def row(mode: Mode, count: Count) -> str:
    """One line of the table."""
    waits = [f"{statistics.mean(us) / 1e6:.1f} / {_share(us, 95) / 1e6:.1f}" for us in (count.in_us, count.out_us)]
    return (
        f"| {mode.name} | {waits[0]} | {waits[1]} | {count.frames / count.tasks:.1f} "
        f"| {count.ride_calls / count.tasks:.2f} | {statistics.mean(count.latency_us) / 1e3:.0f} |"
    )


def _share(values: list[int], per_cent: int) -> int:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, len(ordered) * per_cent // 100)]


def main() -> None:
    """Print a table for each site."""
    words = given(site=(a_site, "standard"), cars=(a_count, 12), seeds=(a_count, 5))
    names, cars, seeds = [words.site], words.cars, range(1, 1 + words.seeds)
    for name in names:
        intervals = f"intervals {INTERVAL_S[0]:.0f} s +- {INTERVAL_S[1]:.0f} s"
        print(f"{name}: {cars} cars in and out, {intervals}, {len(seeds)} seeds")
        print()
        print(
            "| lifts | in: mean / 95 %, s | out, s | negotiation frames a task | ride calls a task | call to bid, ms |"
        )
        print("|---|---|---|---|---|---|")
        for mode in MODES:
            print(row(mode, measure(find_site(name), mode, cars, seeds)), flush=True)
        print()


if __name__ == "__main__":
    main()

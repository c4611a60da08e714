"""Frames on the fleet bus for a task done, message by message, and those of negotiation for a call that was awarded.

    python -m bench.frames [SITE] [--cars 12] [--seeds 3] [--every 30 15]

Cars come, and are fetched, at random; each seed is a run of its own from power-up on. Virtual time: the figures are the
same on every machine.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import CallResult
from onboard.contract.messages import Award, Bid, CallForProposals, Message, TaskReport
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.wire.codec import fleet_codec

#: Customers come this long after power-up, us.
ORIGIN_US = 10_000_000
#: A run that takes longer has got stuck, us.
LIMIT_US = 4 * 3_600_000_000
#: What is said at set times, whatever happens.
PERIODIC = ("BusTime", "Heartbeat")
#: The steps of one negotiation beside its itinerary.
NEGOTIATION = (CallForProposals, Bid, Award, TaskReport)
#: Which messages belong together, by what their names begin with.
FAMILIES = ("Token", "Itinerary", "Call", "Progress", "Sync")


@dataclass
class Count:
    """Frames by message of all runs, and what was done in them."""

    frames: Counter[str] = field(default_factory=Counter)
    negotiation: int = 0
    awarded: int = 0
    tasks: int = 0
    in_us: list[int] = field(default_factory=list)
    out_us: list[int] = field(default_factory=list)

    def see(self, frame: Frame, time_us: int, sender: str) -> None:
        """One frame of the fleet bus."""
        self.frames[fleet_codec().name_of(frame) or "unknown"] += 1

    def hear(self, message: Message, time_us: int) -> None:
        """One message of the fleet bus."""
        if isinstance(message, NEGOTIATION):
            self.negotiation += len(fleet_codec().encode(message))
        self.awarded += isinstance(message, Award) and message.result is CallResult.AWARDED

    def take(self, simulation: Simulation) -> None:
        """Add up what the customers got. Raises ``RuntimeError`` where somebody still waits."""
        street = simulation.plant.street
        summary, broken = street.summary(), simulation.plant.oracle.finish()
        if not street.is_over or broken:
            raise RuntimeError(f"the run did not end well: {summary}, {broken}")
        self.tasks += summary.parked + summary.served
        self.in_us += summary.in_wait_us
        self.out_us += summary.out_wait_us

    @property
    def said_once(self) -> int:
        """All frames but those that are said at set times."""
        return self.frames.total() - sum(self.frames[name] for name in PERIODIC)


async def _play(site: Site, demand: Demand, seed: int, loop: VirtualTimeLoop, count: Count) -> None:
    simulation = build(site, RunOptions(seed=seed), loop)
    simulation.fleet.tap(count.see)
    simulation.observers.append(count.hear)
    simulation.plant.street.add_all(demand, ORIGIN_US)
    simulation.start()
    await run_until(simulation, lambda: simulation.plant.street.is_over, LIMIT_US, 1_000_000)
    count.take(simulation)


def measure(site: Site, cars: int, every_s: tuple[float, float], seeds: range) -> Count:
    """All seeds, one after the other."""
    count = Count()
    for seed in seeds:
        loop = VirtualTimeLoop()
        try:
            loop.run_until_complete(_play(site, Demand.by_mean(*every_s, seed, count=cars), seed, loop, count))
        finally:
            loop.close()
    return count


def table(count: Count) -> list[str]:
    """Frames a task, by family and message, the most frequent first."""
    tasks = max(count.tasks, 1)
    lines = ["| message | frames a task |", "|---|---|"]
    lines += [f"| {name} | {frames / tasks:.1f} |" for name, frames in count.frames.most_common()]
    for family in FAMILIES:
        of_family = sum(frames for name, frames in count.frames.items() if name.startswith(family))
        lines.append(f"| all {family}... | {of_family / tasks:.1f} |")
    without = f"{count.said_once / tasks:.1f} frames a task without heartbeats and bus time"
    waits = [sum(times) / max(len(times), 1) / 1e6 for times in (count.in_us, count.out_us)]
    return [
        *lines,
        "",
        f"{count.tasks} tasks done: {without}, {count.frames.total() / tasks:.1f} with them",
        f"{count.negotiation / tasks:.1f} of them negotiate besides itineraries; {count.awarded / tasks:.2f} awards",
        f"customers waited {waits[0]:.1f} s to leave their car, {waits[1]:.1f} s to get it back",
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table of one site."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", nargs="?", default="standard")
    parser.add_argument("--cars", type=int, default=12)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--every", type=float, nargs=2, default=(30.0, 15.0), metavar=("MEAN_S", "SIGMA_S"))
    options = parser.parse_args(arguments)
    mean_s, sigma_s = options.every
    seeds = range(1, options.seeds + 1)
    print(f"{options.site}: {options.cars} cars in and out, {mean_s:g} +- {sigma_s:g} s, {options.seeds} seeds\n")
    for line in table(measure(find_site(options.site), options.cars, (mean_s, sigma_s), seeds)):
        print(line)


if __name__ == "__main__":
    main()

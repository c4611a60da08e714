"""Response times of a site's fleet bus while it runs, beside their bounds: what ``bench/response_times.py`` prints."""

import asyncio
import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.systems.car_park.burst import burst
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.meter import POWER_UP_US, Meter
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.core.site import Site
from onboard.systems.registry import part
from onboard.trace.response import Stream, fifo_bounds, priority_bounds

#: Mean and standard deviation of the time between arrivals, s.
ARRIVALS_S = (60.0, 20.0)
#: Everybody has long found everybody, us.
FIRST_CAR_US = 20_000_000


@dataclass(frozen=True)
class Measured:
    """One run. ``bounds`` by message, us: of first-in first-out queues and of priority queues; None: there is none.

    ``waits``, us: how long a frame of a message may wait for its sender's budgets before.
    """

    site: Site
    meter: Meter
    load: float
    worst_second: float
    bounds: dict[str, tuple[int | None, int | None]]
    waits: dict[str, int]
    #: Messages of which a second may be queued before the first is out, by both kinds of queue.
    late: tuple[list[str], list[str]]
    power_up_us: int | None
    #: Worst on the bus where all say at one instant what they may.
    burst_us: int
    wrong: list[str]


def measure(site: Site, bit_rate: int, minutes: float, seed: int = 1) -> Measured:
    """Play random arrivals for so long in virtual time."""
    site = dataclasses.replace(site, bitrate=bit_rate)
    loop = VirtualTimeLoop()
    simulation, meter = run_on(loop, _play(site, minutes, seed, loop))
    statistics = simulation.fleet.statistics()
    return judge(site, meter, statistics.mean_load, statistics.worst_second_load)


async def _play(site: Site, minutes: float, seed: int, loop: VirtualTimeLoop) -> tuple[Simulation, Meter]:
    simulation = build(site, RunOptions(seed=seed), loop)
    meter = Meter()
    meter.watch(simulation.fleet)
    simulation.before_start.append(lambda one: meter.listen(one.holon.machine.name, one.outgoing))
    cars = max(1, round(minutes * 60 / ARRIVALS_S[0]))
    simulation.plant.street.add_all(Demand.by_mean(*ARRIVALS_S, seed, count=cars), FIRST_CAR_US)
    simulation.start()
    await run_until(simulation, lambda: False, round(minutes * 60e6), 1_000_000)
    violations = simulation.plant.oracle.finish()
    assert not violations, violations[0]
    # Journals that are being written when the time is over.
    for task in asyncio.all_tasks() - {asyncio.current_task()}:
        task.cancel()
    await asyncio.sleep(0)
    return simulation, meter


def judge(site: Site, meter: Meter, load: float, worst_second: float) -> Measured:
    """Bounds of a site's traffic, and where a run was above them."""
    traffic = part(site.system, "traffic")
    assert traffic is not None, f"what machines of a {site.called} may send at most is not written down"
    running, starting = traffic.operation(site), traffic.power_up(site)
    bounds = worst_by_message(running, site.bitrate)
    start = [bound.response_us for bound in fifo_bounds(starting, site.bitrate)]
    power_up_us = None if None in start else max(bound for bound in start if bound is not None)
    wrong = traffic.excess(starting, [one for one in meter.queued if one[0] < POWER_UP_US])
    wrong += traffic.excess(running, [one for one in meter.queued if one[0] >= POWER_UP_US])
    waits, worst_case = traffic.waits(site), burst(site)
    wrong += traffic.excess(running, worst_case.queued)
    wrong += [f"{name}: no bound" for name, (fifo_us, _) in bounds.items() if fifo_us is None]
    most = {name: fifo_us for name, (fifo_us, _) in bounds.items() if fifo_us is not None}
    for one in (meter, worst_case):
        wrong += _too_late(one.on_bus, most, power_up_us)
        wrong += _too_late(one.worst, {name: us + waits.get(name, 0) for name, us in most.items()}, power_up_us)
    queues = (fifo_bounds(running, site.bitrate), priority_bounds(running, site.bitrate))
    fifo, priority = (list(dict.fromkeys(b.stream.name for b in found if not b.is_met)) for found in queues)
    burst_us = max(worst_case.on_bus.values())
    return Measured(site, meter, load, worst_second, bounds, waits, (fifo, priority), power_up_us, burst_us, wrong)


def _too_late(measured: dict[tuple[bool, str], int], bounds: dict[str, int], power_up_us: int | None) -> Iterator[str]:
    for (at_start, name), worst_us in sorted(measured.items()):
        bound_us = power_up_us if at_start else bounds.get(name)
        if bound_us is not None and worst_us > bound_us:
            yield f"{name}: {worst_us} us measured, above its bound of {bound_us} us"


def worst_by_message(streams: list[Stream], bit_rate: int) -> dict[str, tuple[int | None, int | None]]:
    """Greatest bound of each message over all nodes: first-in first-out, then by priority."""
    found: dict[str, tuple[int | None, int | None]] = {}
    for fifo, priority in zip(fifo_bounds(streams, bit_rate), priority_bounds(streams, bit_rate), strict=True):
        before = found.get(fifo.stream.name, (0, 0))
        found[fifo.stream.name] = (_worse(before[0], fifo.response_us), _worse(before[1], priority.response_us))
    return found


def _worse(one: int | None, other: int | None) -> int | None:
    return None if one is None or other is None else max(one, other)

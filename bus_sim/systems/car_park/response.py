"""Response times of a site's fleet bus while it runs, beside their bounds: what ``bench/response_times.py`` prints."""

import asyncio
import dataclasses
from collections import deque
from dataclasses import dataclass, field

from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import TaskReport
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.systems.registry import part
from onboard.trace.response import Stream, fifo_bounds, priority_bounds
from onboard.wire.codec import fleet_codec

#: Mean and standard deviation of the time between arrivals, s.
ARRIVALS_S = (60.0, 20.0)
#: All machines have found each other by then, us; the first car comes later.
POWER_UP_US = 12_000_000
FIRST_CAR_US = 20_000_000


@dataclass
class Meter:
    """Queueing and response of every frame of a medium's nodes."""

    #: Time queued (us), node-ID and message, in order of time.
    queued: list[tuple[int, int, str]] = field(default_factory=list)
    #: Worst response in us by message, of frames queued while all start and afterwards.
    worst: dict[tuple[bool, str], int] = field(default_factory=dict)
    frames: int = 0
    #: Of these, heartbeats and bus time, which come whether anybody works or not.
    periodic: int = 0
    tasks: int = 0
    _waiting: dict[str, deque[tuple[int, Frame]]] = field(default_factory=dict)

    def attach(self, simulation: Simulation) -> None:
        """Watch a fleet bus that has not begun."""
        simulation.fleet.tap_queues(self._on_queued)
        simulation.fleet.tap(self._on_end, errors=False)

    def _on_queued(self, frame: Frame, time_us: int, node: str) -> None:
        name = fleet_codec().name_of(frame) or "?"
        self.queued.append((time_us, frame.arbitration_id & 0xFF, name))
        self._waiting.setdefault(node, deque()).append((time_us, frame))

    def _on_end(self, frame: Frame, time_us: int, node: str) -> None:
        queued_us, first = self._waiting[node].popleft()
        assert first == frame, "a node's frames leave in the order in which they were queued"
        self.frames += 1
        self.periodic += fleet_codec().name_of(frame) in ("Heartbeat", "BusTime")
        key = (queued_us < POWER_UP_US, fleet_codec().name_of(frame) or "?")
        self.worst[key] = max(self.worst.get(key, 0), time_us - queued_us)
        message = fleet_codec().decode_part(frame)
        if isinstance(message, TaskReport) and message.phase is TaskPhase.DONE:
            self.tasks += 1


@dataclass(frozen=True)
class Measured:
    """One run. ``bounds`` by message, us: of first-in first-out queues and of priority queues; None: there is none."""

    site: Site
    meter: Meter
    load: float
    worst_second: float
    bounds: dict[str, tuple[int | None, int | None]]
    #: Messages of which a second may be queued before the first is out, by both kinds of queue.
    late: tuple[list[str], list[str]]
    power_up_us: int | None
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
    meter.attach(simulation)
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
    assert traffic is not None, f"what machines of a {site.system} may send at most is not written down"
    running, starting = traffic.operation(site), traffic.power_up(site)
    bounds = worst_by_message(running, site.bitrate)
    start = [bound.response_us for bound in fifo_bounds(starting, site.bitrate)]
    power_up_us = None if None in start else max(bound for bound in start if bound is not None)
    wrong = traffic.excess(starting, [one for one in meter.queued if one[0] < POWER_UP_US])
    wrong += traffic.excess(running, [one for one in meter.queued if one[0] >= POWER_UP_US])
    for (at_start, name), worst_us in sorted(meter.worst.items()):
        bound_us = power_up_us if at_start else bounds.get(name, (None, None))[0]
        if bound_us is not None and worst_us > bound_us:
            wrong.append(f"{name}: {worst_us} us measured, above its bound of {bound_us} us")
    queues = (fifo_bounds(running, site.bitrate), priority_bounds(running, site.bitrate))
    fifo, priority = (list(dict.fromkeys(b.stream.name for b in found if not b.is_met)) for found in queues)
    return Measured(site, meter, load, worst_second, bounds, (fifo, priority), power_up_us, wrong)


def worst_by_message(streams: list[Stream], bit_rate: int) -> dict[str, tuple[int | None, int | None]]:
    """Greatest bound of each message over all nodes: first-in first-out, then by priority."""
    found: dict[str, tuple[int | None, int | None]] = {}
    for fifo, priority in zip(fifo_bounds(streams, bit_rate), priority_bounds(streams, bit_rate), strict=True):
        before = found.get(fifo.stream.name, (0, 0))
        found[fifo.stream.name] = (_worse(before[0], fifo.response_us), _worse(before[1], priority.response_us))
    return found


def _worse(one: int | None, other: int | None) -> int | None:
    return None if one is None or other is None else max(one, other)

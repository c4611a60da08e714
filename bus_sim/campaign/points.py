"""Every single fault of one kind in one reference scene: an omission, a duplicate or a crash.

The scene is played once without faults and everything is counted that a fault could strike; then each point is a
trial of its own. A point is named by its number, so that any part of the whole can be played anywhere, again and alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Final

from bus_sim.campaign.journal_points import journal_faults
from bus_sim.campaign.trial import STEP_US
from bus_sim.can.faults import Fault, FaultKind
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.faults.scenario import Arrivals, Scenario
from bus_sim.run import RunOptions, build, run_until
from bus_sim.systems.car_park.stage import ORIGIN_US, is_over
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.core.frame import Frame
from onboard.core.site import Site

#: A frame comes again so long after it came, us: after what follows it at once. Ours.
AGAIN_US = 3_000
#: A crashed controller is off for so long, s: peers do not notice it (early), or do (late). Ours.
RESTARTS_S = (0.5, 9.0)


class Single(StrEnum):
    """What each trial has exactly one of."""

    OMISSION = "omission"
    DUPLICATE = "duplicate"
    CRASH = "crash"
    JOURNAL = "journal"


class Scene(StrEnum):
    """Who comes in the reference scene."""

    ALONE = "alone"
    OVERLAP = "overlap"


SCENES: Final[dict[Scene, Arrivals]] = {
    # One car, fetched two minutes later.
    Scene.ALONE: Arrivals(cars=1, mean_s=5.0, sigma_s=1.0, min_stay_s=120.0),
    # Three so close that two robots carry at the same time, and that some are fetched while others come.
    Scene.OVERLAP: Arrivals(cars=3, mean_s=30.0, sigma_s=10.0, min_stay_s=60.0),
}

#: The longest that it may take under a fault, s, unless another limit is asked for. Ours.
SCENE_LIMIT_S = 7_200.0


@dataclass
class Counts:
    """What the scene has: who sent each frame of the fleet bus; by machine, frames queued on any bus and entries."""

    fleet_senders: list[str]
    sent: dict[str, int]
    written: dict[str, int]
    longest_wait_s: float


def reference(site_name: str, limit_s: float, scene: Scene = Scene.ALONE) -> Scenario:
    """The scene without a fault."""
    return Scenario(site_name, 1, limit_s, SCENES[scene])


def count(site: Site, scenario: Scenario) -> Counts:
    """Play the scene without a fault, and count."""
    loop = VirtualTimeLoop()
    return run_on(loop, _count(site, scenario, loop))


async def _count(site: Site, scenario: Scenario, loop: VirtualTimeLoop) -> Counts:
    simulation = build(site, RunOptions(seed=scenario.seed), loop)
    street = simulation.plant.street
    street.add_all(scenario.arrivals.demand(scenario.seed), ORIGIN_US)
    machines = simulation.site.machines
    found = Counts([], dict.fromkeys((one.name for one in machines.values()), 0), {}, 0.0)

    def on_fleet(_frame: Frame, _time_us: int, sender: str) -> None:
        found.fleet_senders.append(sender)

    def on_queue(_frame: Frame, _time_us: int, sender: str) -> None:
        if sender in found.sent:
            found.sent[sender] += 1

    simulation.fleet.tap(on_fleet)
    for medium in (simulation.fleet, *simulation.devices.values()):
        medium.tap_queues(on_queue)
    simulation.start()
    await run_until(simulation, lambda: is_over(street), round(scenario.limit_s * 1e6), STEP_US)
    found.written = {machines[node].name: len(journal.entries) for node, journal in simulation.journals.items()}
    summary = street.summary()
    found.longest_wait_s = max((*summary.in_wait_us, *summary.out_wait_us), default=0) / 1e6
    return found


def points(site: Site, single: Single, counts: Counts) -> list[AnyFault]:
    """Every point of a kind, in an order that is always the same."""
    return _POINTS[single](site, counts)


def _frames(kind: FaultKind, delay_us: int, site: Site, counts: Counts) -> list[AnyFault]:
    """The n-th frame of the fleet bus, at each of its receivers."""
    return [
        Fault(kind, receivers=(machine.name,), nth=number, delay_us=delay_us)
        for number, sender in enumerate(counts.fleet_senders, start=1)
        for machine in site.machines.values()
        if machine.name != sender
    ]


def _crashes(_: Site, counts: Counts) -> list[AnyFault]:
    """Before each frame, and before and after each journal write is durable; the power is off short or long."""
    found: list[AnyFault] = []
    for name, frames in counts.sent.items():
        for restart_s in RESTARTS_S:
            base: dict[str, str | int | float] = {"target": name, "at_s": 0.0, "restart_s": restart_s}
            found += [Injection("crash", {**base, "frame": number}) for number in range(1, frames + 1)]
            found += [
                Injection("crash", {**base, "write": number, "durable": durable})
                for number in range(1, counts.written[name] + 1)
                for durable in ("no", "yes")
            ]
    return found


_POINTS: dict[Single, Callable[[Site, Counts], list[AnyFault]]] = {
    Single.OMISSION: partial(_frames, FaultKind.OMISSION, 0),
    Single.DUPLICATE: partial(_frames, FaultKind.DUPLICATE, AGAIN_US),
    Single.CRASH: _crashes,
    Single.JOURNAL: lambda _, counts: journal_faults(counts.written),
}

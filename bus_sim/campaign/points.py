"""Every single fault of one kind in one reference scene: an omission, a duplicate or a crash.

The scene is played once without faults and everything is counted that a fault could strike; then each point is a
trial of its own. A point is named by its number, so that any part of the whole can be played anywhere, again and alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

from bus_sim.campaign.journal_points import journal_faults
from bus_sim.campaign.trial import STEP_US
from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.core.frame import Frame
from onboard.core.site import Site

#: A frame comes again so long after it came, us: after what follows it at once.
AGAIN_US = 3_000
#: A crashed controller is off for so long, s: peers do not notice it (early), or do (late).
RESTARTS_S = (0.5, 9.0)


class Single(StrEnum):
    """What each trial has exactly one of."""

    OMISSION = "omission"
    DUPLICATE = "duplicate"
    CRASH = "crash"
    JOURNAL = "journal"


class SceneOccasion(StrEnum):
    """Who comes in the reference scene: an occasion (``bus_sim.systems.system``)."""

    ALONE = "alone"
    OVERLAP = "overlap"


@dataclass
class SceneCounts:
    """What the scene has: who sent each frame of the fleet bus; by machine, frames queued on any bus and entries."""

    fleet_senders: list[str]
    sent: dict[str, int]
    written: dict[str, int]
    longest_wait_s: float


def reference(site_name: str, limit_s: float | None, scene: SceneOccasion = SceneOccasion.ALONE) -> FaultScenario:
    """The scene without a fault; ``limit_s`` is the longest that it may take under one, None: as its system has it."""
    site = find_site(site_name)
    system = simulated_of(site)
    demand = system.on(Occasion(scene), site)
    return FaultScenario(site_name, 1, limit_s or system.patience_s(site, demand, 1), demand)


def count(site: Site, scenario: FaultScenario) -> SceneCounts:
    """Play the scene without a fault, and count."""
    loop = VirtualTimeLoop()
    return run_on(loop, _count(site, scenario, loop))


async def _count(site: Site, scenario: FaultScenario, loop: VirtualTimeLoop) -> SceneCounts:
    stage = simulated_of(site).stage(site, RunOptions(seed=scenario.seed, demand=scenario.demand), loop)
    run, machines = stage.run, stage.run.site.machines
    found = SceneCounts([], dict.fromkeys((one.name for one in machines.values()), 0), {}, 0.0)

    def on_fleet(_frame: Frame, _time_us: int, sender: str) -> None:
        found.fleet_senders.append(sender)

    def on_queue(_frame: Frame, _time_us: int, sender: str) -> None:
        if sender in found.sent:
            found.sent[sender] += 1

    run.fleet.tap(on_fleet)
    for medium in (run.fleet, *run.devices.values()):
        medium.tap_queues(on_queue)
    run.start()
    await run_until(run, lambda: stage.is_over, round(scenario.limit_s * 1e6), STEP_US)
    found.written = {machines[node].name: len(journal.entries) for node, journal in run.journals.items()}
    found.longest_wait_s = stage.tally().longest_wait_s
    return found


def points(site: Site, single: Single, counts: SceneCounts, person_s: float = 0.0) -> list[AnyFault]:
    """Every point of a kind, in an order that is always the same; ``person_s`` as in ``journal_faults``."""
    if single is Single.JOURNAL:
        return journal_faults(counts.written, person_s)
    return _POINTS[single](site, counts)


def _frames(kind: FaultKind, delay_us: int, site: Site, counts: SceneCounts) -> list[AnyFault]:
    """The n-th frame of the fleet bus, at each of its receivers."""
    return [
        InjectedFault(kind, receivers=(machine.name,), nth=number, delay_us=delay_us)
        for number, sender in enumerate(counts.fleet_senders, start=1)
        for machine in site.machines.values()
        if machine.name != sender
    ]


def _crashes(_: Site, counts: SceneCounts) -> list[AnyFault]:
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


_POINTS: dict[Single, Callable[[Site, SceneCounts], list[AnyFault]]] = {
    Single.OMISSION: partial(_frames, FaultKind.OMISSION, 0),
    Single.DUPLICATE: partial(_frames, FaultKind.DUPLICATE, AGAIN_US),
    Single.CRASH: _crashes,
}

"""After a common power cut: does every machine of a site take part again by itself, and how soon?

All controllers lose their power in the middle of the site's work and get it back together, all of them or all but one.
A machine takes part once its heartbeat says so; nobody does anything by hand.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from bus_sim.campaign.judges import Judges
from bus_sim.campaign.recovery import ADMITTED
from bus_sim.campaign.trial import STEP_US, stage_of
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stage import SystemStage
from bus_sim.systems.system import Occasion
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import Heartbeat, Message
from onboard.core.site import Site

#: A site starts by itself within this, s (issue 13, point 1).
STARTS_S = 30.0
#: The power is off for so long, s: longer than any device keeps an order.
OFF_S = 5.0
#: When it is cut, s after power-up: at work, with cars or loads on the way.
MOMENTS_S = (45.0, 75.0, 110.0)


@dataclass(frozen=True)
class Start:
    """One cut at ``at_s`` and what came of it: ``late`` machines do not take part in time, ``wrong`` must never be."""

    site: str
    at_s: float
    missing: str | None
    longest_s: float
    late: tuple[str, ...]
    wrong: tuple[str, ...]

    @property
    def is_good(self) -> bool:
        """Whether everybody that has power takes part in time, and nothing else happened."""
        return not self.late and not self.wrong

    def __str__(self) -> str:
        who = "nobody" if self.missing is None else self.missing
        told = f"{self.site}: cut at {self.at_s:g} s, {who} missing: all take part after {self.longest_s:.1f} s"
        late = f"; NOT in time: {', '.join(self.late)}" if self.late else ""
        return told + late + "".join(f"; {one}" for one in self.wrong)


def cold_starts(
    site: Site, name: str, moments_s: Sequence[float] = MOMENTS_S, sample: int | None = None
) -> Iterator[Start]:
    """Each moment, with nobody missing and with each machine missing in turn; of these ``sample``, evenly spread."""
    missing = (None, *(machine.name for machine in site.machines.values()))
    every = [(at_s, who) for at_s in moments_s for who in missing]
    number = len(every) if sample is None else min(sample, len(every))
    for index in range(number):
        yield cold_start(site, name, *every[index * len(every) // number])


def cold_start(site: Site, name: str, at_s: float, missing: str | None) -> Start:
    """One cut; ``name`` is the site's for ``bus-sim``."""
    loop = VirtualTimeLoop()
    return run_on(loop, _cold_start(site, name, at_s, missing, loop))


async def _cold_start(site: Site, name: str, at_s: float, missing: str | None, loop: VirtualTimeLoop) -> Start:
    busy = simulated_of(site).on(Occasion.BUSY, site)
    stage = stage_of(site, FaultScenario(name, 1, at_s + OFF_S + STARTS_S, busy), loop)
    run = stage.run
    for medium in run.devices.values():
        # A device bus has several nodes, so that a frame is acknowledged though the controller is off.
        medium.attach("terminal block", None)
    # So has the fleet bus, whoever of two machines is missing: somebody keeps the log.
    run.fleet.attach("recorder", None)
    judges = Judges(run, disturbed=True)
    takes_part: dict[int, int] = {}

    def hear(message: Message, time_us: int) -> None:
        if isinstance(message, Heartbeat) and message.state in ADMITTED:
            takes_part.setdefault(message.sender, time_us)

    run.start()
    await run_until(run, lambda: False, round(at_s * 1e6), STEP_US)
    for machine in site.machines.values():
        run.crash(machine)
    await run_until(run, lambda: False, round((at_s + OFF_S) * 1e6), STEP_US)
    run.observers.append(hear)
    began_us, back = loop.now_us(), [one for one in site.machines.values() if one.name != missing]
    for machine in back:
        run.start_controller(machine)
    # Bus time comes from fixed machines: where none has power nobody can know it, and all stay as they are.
    has_time = any(machine.kind not in MOBILE_KINDS for machine in back)
    wanted = {machine.node_id for machine in back} if has_time else set[int]()
    await run_until(run, lambda: wanted <= takes_part.keys(), round(began_us + STARTS_S * 1e6), STEP_US)
    late = tuple(machine.name for machine in back if machine.node_id in wanted - takes_part.keys())
    longest_us = max((takes_part[node] - began_us for node in wanted & takes_part.keys()), default=0)
    run.close()
    return Start(name, at_s, missing, longest_us / 1e6, late, tuple(_wrong(stage, judges)))


def _wrong(stage: SystemStage[Any], judges: Judges) -> Iterator[str]:
    """What must never happen, and machines that halted."""
    unsafe, _ = judges.finish()
    yield from stage.violations()
    yield from unsafe
    for controller in stage.run.controllers.values():
        if controller.holon.halted is not None:
            yield f"{controller.holon.machine.name} halted: {controller.holon.halted}"

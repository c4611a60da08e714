"""One run of a terminal: built, run to the end of its missions, and its indicators."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from bus_sim.devices.timers import LoopTimers
from bus_sim.run import BusRun, RunOptions, buses_of, run_until
from bus_sim.systems.session import links_of
from bus_sim.systems.terminal.deliveries import Delivery, deliveries, ordered
from bus_sim.systems.terminal.plant import NOISE, TerminalPlant
from bus_sim.systems.watched import watched
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.messages import CarAt, Message
from onboard.systems.terminal.desk import Desk
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import Vehicle
from onboard.ways.cars import CarMirror

#: Looks whether it is over, us.
STEP_US = 1_000_000
#: A run that does not end by itself ends here, us.
LIMIT_US = 3_600_000_000


@dataclass
class TerminalRun(BusRun):
    """A terminal that can be run. ``spectator`` is what somebody who only listens to the fleet bus knows."""

    plant: TerminalPlant
    spectator: TerminalMirror = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        site, listener = self.plant.site, min(self.site.machines)
        self.spectator = TerminalMirror(site, listener, CarMirror(site, listener))
        self.observers.append(self._listen)

    def _listen(self, message: Message, time_us: int) -> None:
        if isinstance(message, CarAt):
            self.spectator.fleet.on_car(message)
        self.spectator.hear(message, time_us)


@dataclass(frozen=True)
class Outcome:
    """What a run came to. ``touched`` counts plans that their owners made anew; ``events`` disturbances."""

    deliveries: tuple[Delivery, ...]
    ordered: int
    ended_us: int
    touched: int
    disturbances: int
    frames: int
    busy: float
    violations: tuple[str, ...]
    halted: tuple[str, ...]
    interrupted: int = 0

    @property
    def is_good(self) -> bool:
        """Whether all was delivered and nothing broke."""
        return not self.violations and not self.halted and len(self.deliveries) == self.ordered

    def mean_s(self, what: Callable[[Delivery], int]) -> float:
        """Mean over all deliveries, s."""
        return sum(map(what, self.deliveries)) / max(1, len(self.deliveries)) / 1e6


def build(site: Terminal, options: RunOptions, loop: VirtualTimeLoop, *, noise: float = NOISE) -> TerminalRun:
    """All parts of a run, connected but not switched on."""
    fleet, devices = buses_of(site, options, loop)
    plant = TerminalPlant(site, LoopTimers(loop), links_of(site, devices), options.seed, noise=noise)
    return TerminalRun(site, options, loop, fleet, devices, plant)


def outcome(run: TerminalRun) -> Outcome:
    """The indicators of a run so far."""
    site = run.plant.site
    vehicles = [one.holon.behaviour for one in run.controllers.values() if isinstance(one.holon.behaviour, Vehicle)]
    desks = [one.holon.behaviour for one in run.controllers.values() if isinstance(one.holon.behaviour, Desk)]
    halted = tuple(
        f"{one.holon.machine.name}: {one.holon.halted}" for one in run.controllers.values() if one.holon.halted
    )
    statistics = run.fleet.statistics()
    return Outcome(
        tuple(deliveries(site, run.plant.world.handled)),
        ordered(site),
        max((one.time_us for one in run.plant.world.handled), default=0),
        sum(vehicle.planner.touched for vehicle in vehicles),
        len(site.blockages),
        statistics.frames,
        statistics.mean_load,
        tuple(run.plant.world.violations),
        halted,
        sum(desk.interrupted for desk in desks),
    )


def is_ended(plant: TerminalPlant) -> bool:
    """All missions are done, or something must never have happened."""
    return bool(plant.violations) or plant.is_over


def play(
    site: Terminal,
    options: RunOptions,
    *,
    limit_us: int = LIMIT_US,
    noise: float = NOISE,
    prepare: Callable[[TerminalRun], None] | None = None,
    show: Callable[[TerminalRun], None] | None = None,
    web: str | None = None,
) -> Outcome:
    """Run a site on a loop of its own. ``prepare`` gets the run before it is switched on, ``show`` after each step.

    With ``web`` its page is served there, and it goes on until ``limit_us`` or a person's Ctrl-C.
    """
    loop = VirtualTimeLoop(pace=options.pace)
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_play(site, options, loop, limit_us, noise, prepare, show, web))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


async def _play(
    site: Terminal,
    options: RunOptions,
    loop: VirtualTimeLoop,
    limit_us: int,
    noise: float,
    prepare: Callable[[TerminalRun], None] | None,
    show: Callable[[TerminalRun], None] | None,
    web: str | None,
) -> Outcome:
    run = build(site, options, loop, noise=noise)
    if prepare is not None:
        prepare(run)
    run.start()
    picture = (lambda: show(run)) if show is not None else None
    async with watched(run, web) as viewer:
        await run_until(
            run, lambda: viewer.is_gone or (is_ended(run.plant) and not viewer.is_there), limit_us, STEP_US, picture
        )
    found = outcome(run)
    run.close()
    return found

"""One run of a site whose plant knows when it is over: buses, controllers, faults, the end, and what came of it."""

import asyncio
import json
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self, cast

from rich.console import Console
from rich.live import Live
from rich.text import Text

from bus_sim.can.medium import Medium
from bus_sim.demand import DemandError
from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import LoopTimers, Timers
from bus_sim.faults.arm import arm, check_targets, frame_faults
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.run import BusRun, RunOptions, Simulation, buses_of, run_until
from bus_sim.systems.watched import FOREVER_US, watched
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.wire.decoder import Decoder

if TYPE_CHECKING:
    from bus_sim.systems.registry import SystemOptions

#: Pictures of a run that is watched, a second.
PICTURES_S = 10
STEP_US = 500_000
#: Kinds of fault that need nothing of the plant but its timers; beside them all faults of single frames.
FAULTS = frozenset(
    {
        *("burst", "bit_errors", "lossy", "reorder", "bus_off", "partition", "overflow", "babble", "attack"),
        *("crash", "pause", "slow_node", "disk_full", "power_cut", "drift", "clock_jump"),
    }
)
#: After the plant is done the machines may finish what they say, us.
TAIL_US = 3_000_000
#: A run that does not end by itself ends here, us.
LIMIT_US = 4 * 3_600_000_000


class SystemPlant(Protocol):
    """What a run asks of the plant."""

    timers: Timers
    violations: list[str]

    def start(self) -> None:
        """Power on: every device tells how it stands."""

    @property
    def is_over(self) -> bool:
        """Whether everybody was served or told why."""


#: Makes the plant from the site, its timers, each machine's link to its device bus, and the seed.
PlantMaker = Callable[[Site, Timers, dict[int, BusDeviceLink], int], SystemPlant]


@dataclass
class Played:
    """A run that has ended. ``messages`` are those of the fleet bus, with their times."""

    run: BusRun
    plant: SystemPlant
    messages: list[tuple[int, Message]]
    is_over: bool
    wall_s: float

    @property
    def halted(self) -> list[str]:
        """Machines that stopped safely, and why."""
        found = ((one.holon.machine.name, one.holon.halted) for one in self.run.controllers.values())
        return [f"{name}: {why}" for name, why in found if why is not None]

    @property
    def is_good(self) -> bool:
        """Nothing broke, nobody stopped, and everybody was served or told why."""
        return self.is_over and not self.plant.violations and not self.halted


def play(
    site: Site,
    options: "SystemOptions",
    make_plant: PlantMaker,
    picture: Callable[[BusRun, SystemPlant], str] | None = None,
    prepare: Callable[[BusRun], None] | None = None,
) -> Played:
    """Run a site until its plant is done, or to ``limit_s``.

    Raises ``DemandError``, before anything has run, for a fault that this site cannot have.
    """
    check_faults(options.faults, site)
    loop = VirtualTimeLoop(pace=options.speed)
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_play(site, options, make_plant, picture, prepare, loop))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


def check_faults(faults: tuple[AnyFault, ...], site: Site) -> None:
    """Faults of buses and of controllers are the same everywhere; those of doors, cars and customers are not.

    Raises ``DemandError`` for one of those, and for a machine that is not there.
    """
    for fault in faults:
        if isinstance(fault, Injection) and fault.kind not in FAULTS:
            known = ", ".join(sorted(FAULTS))
            raise DemandError(
                f"--fault {fault}: only a car park has it, and {site.name} is a {site.system}; use {known}"
            )
    try:
        check_targets(faults, site)
    except ValueError as error:
        raise DemandError(f"--fault: {error}") from error


def links_of(site: Site, devices: dict[int, Medium]) -> dict[int, BusDeviceLink]:
    """The plant's end of each machine's device bus, by node-ID."""
    codec = codecs_for(site).device
    return {
        node: BusDeviceLink(medium.attach("plant", node), codec, Decoder(codec), node)
        for node, medium in devices.items()
    }


def build(site: Site, options: RunOptions, loop: VirtualTimeLoop, make_plant: PlantMaker) -> tuple[BusRun, SystemPlant]:
    """All parts of a run, connected but not switched on."""
    fleet, devices = buses_of(site, options, loop)
    plant = make_plant(site, LoopTimers(loop), links_of(site, devices), options.seed)
    return BusRun(site, options, loop, fleet, devices, plant), plant


def arm_all(run: BusRun, faults: Iterable[AnyFault]) -> None:
    """Set up all faults but those of single frames, of the kinds in ``FAULTS``; before ``BusRun.start``."""
    # Faults of the bus and of controllers ask of a run what every run has; those of cars and doors name no such thing.
    arm(cast("Simulation", run), faults)


async def _play(
    site: Site,
    options: "SystemOptions",
    make_plant: PlantMaker,
    picture: Callable[[BusRun, SystemPlant], str] | None,
    prepare: Callable[[BusRun], None] | None,
    loop: VirtualTimeLoop,
) -> Played:
    began_s = time.perf_counter()
    run_options = RunOptions(
        seed=options.seed,
        epoch_us=options.epoch_us,
        trace=options.trace,
        trace_devices=options.devices,
        faults=frame_faults(options.faults, site),
    )
    run, plant = build(site, run_options, loop, make_plant)
    messages: list[tuple[int, Message]] = []
    run.observers.append(lambda message, time_us: messages.append((time_us, message)))
    arm_all(run, options.faults)
    if prepare is not None:
        prepare(run)
    run.start()
    limit_us = round(options.limit_s * 1e6) if options.limit_s is not None else LIMIT_US
    shown = picture if options.speed is not None and not options.quiet else None
    async with watched(run, options.web) as viewer:
        if viewer.is_there and options.limit_s is None:
            limit_us = FOREVER_US

        def is_over() -> bool:
            return viewer.is_gone or bool(plant.violations) or (plant.is_over and not viewer.is_there)

        with _Watcher(run, plant, shown) as watcher:
            over = await run_until(run, is_over, limit_us, STEP_US, watcher.show)
            if over:
                await asyncio.sleep(TAIL_US / 1e6)
    run.close()
    return Played(run, plant, messages, plant.is_over, time.perf_counter() - began_s)


class _Watcher:
    """Draws the picture while a run is watched in a terminal."""

    def __init__(self, run: BusRun, plant: SystemPlant, picture: Callable[[BusRun, SystemPlant], str] | None) -> None:
        self._run, self._plant, self._picture = run, plant, picture
        console = Console()
        wanted = picture is not None and console.is_terminal
        self._live = Live(console=console, auto_refresh=False, transient=True) if wanted else None
        self._next_s = 0.0

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self) -> None:
        """A new picture, not too often."""
        if self._live is None or self._picture is None or time.perf_counter() < self._next_s:
            return
        self._next_s = time.perf_counter() + 1 / PICTURES_S
        self._live.update(Text(self._picture(self._run, self._plant), no_wrap=True), refresh=True)


def conclude(played: Played, site: Site, options: "SystemOptions", figures: dict[str, object], quiet: bool) -> int:
    """Print the figures that every system's run ends with, and its own; write them as JSON; the exit status."""
    statistics = played.run.fleet.statistics()
    now_us = played.run.loop.now_us()
    whole: dict[str, object] = {
        "site": site.name,
        "seed": options.seed,
        "simulated_s": round(now_us / 1e6, 3),
        **figures,
        "frames": statistics.frames,
        "violations": list(played.plant.violations),
        "halted": played.halted,
        "over": played.is_over,
    }
    if options.json is not None:
        options.json.write_text(json.dumps(whole, indent=2) + "\n", encoding="utf-8")
    if not quiet:
        for name, value in whole.items():
            sys.stdout.write(f"{name.replace('_', ' ')}: {_shown(value)}\n")
        sys.stdout.write(f"wall time: {played.wall_s:.1f} s\n")
    return 0 if played.is_good else 1


def _shown(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(one) for one in value) or "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)

"""One scenario played on one target: the fleet is put up, the device joins, and what came of it is judged."""

import asyncio
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bus_sim.journal import WRITE_US
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from bus_sim.virtual_time import VirtualTimeLoop
from hil.bench import Bench, Capability, Target, TargetKind
from hil.board_device import BoardDevice
from hil.device import Device
from hil.judge import Judgement, judge
from hil.latency import Latencies, latencies_of
from hil.process_device import ProcessDevice
from hil.scenarios.scenario import BenchScenario
from hil.short_circuit import waiting_fault
from hil.simulated_device import SimulatedDevice
from hil.stage import TestBench

#: Journal entries that one machine may have waiting at the end; a bound for a broken one.
MOST_WRITES = 1_000


@dataclass(frozen=True)
class ScenarioOutcome:
    """What came of a scenario. ``failure`` is what the device did otherwise than it should, None where nothing."""

    failure: str | None
    judgement: Judgement
    latencies: Latencies

    @property
    def is_good(self) -> bool:
        """Whether the scenario went as it should, and left nothing wrong behind."""
        return self.failure is None and not self.judgement.faults

    def lines(self) -> list[str]:
        """What went wrong, one line each."""
        return [*([self.failure] if self.failure is not None else []), *self.judgement.faults]

    def properties(self) -> dict[str, int]:
        """Figures for the report of the test."""
        found = dict(self.latencies.worst())
        counters = self.judgement.counters
        if counters is not None:
            found |= {"tec": counters.tec, "rec": counters.rec, "sent": counters.sent, "received": counters.received}
        return found | {f"dropped_{reason.name.lower()}": count for reason, count in self.judgement.drops.items()}


def missing(scenario: BenchScenario, target: Target) -> list[Capability]:
    """Capabilities that the scenario asks for and the target has not, in order."""
    return sorted(scenario.needs - target.capabilities)


def play(
    bench: Bench,
    target: Target,
    scenario: BenchScenario,
    directory: Path,
    prepare: Callable[[Device], None] | None = None,
) -> ScenarioOutcome:
    """Play a scenario; ``directory`` gets the trace and, for a process, its files.

    Raises ``BenchError`` and ``BusOpenError`` where the bench itself fails. ``prepare`` is given the device before
    anything has happened.
    """
    is_virtual = target.kind is TargetKind.SIMULATED
    loop = VirtualTimeLoop(pace=None if is_virtual else 1.0)
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_play(bench, target, scenario, directory, prepare, loop))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


async def _play(
    bench: Bench,
    target: Target,
    scenario: BenchScenario,
    directory: Path,
    prepare: Callable[[Device], None] | None,
    loop: VirtualTimeLoop,
) -> ScenarioOutcome:
    options = RunOptions(
        epoch_us=0 if target.kind is TargetKind.SIMULATED else round(time.time() * 1e6),
        trace=directory / "trace.log",
        devices=True,
        faults=(waiting_fault(target.machine.node_id),),
        without=scenario.without(bench.site, target.machine),
    )
    system = simulated_of(bench.site)
    # Nobody comes but whom the scenario brings: what a site asks of its runs is no machine's business.
    nothing: dict[str, Any] = dict.fromkeys(bench.site.demand, ())
    bare = replace(bench.site, **nothing)
    world = system.stage(bare, replace(options, demand=system.on(Occasion.NOBODY, bare)), loop)
    simulation = world.run
    for medium in simulation.devices.values():
        # A device bus has several nodes, so that a frame is acknowledged though the controller is off.
        medium.attach("bench")
    async with AsyncExitStack() as stack:
        stack.callback(simulation.close)
        device = await _open(simulation, target, directory)
        stack.push_async_callback(stop_fleet, simulation)
        stack.push_async_callback(device.close)
        if prepare is not None:
            prepare(device)
        stage = TestBench(world, bench.site, target.machine, device, bench.site_text)
        simulation.start()
        failure = None
        try:
            await scenario.play(stage)
        except AssertionError as error:
            failure = str(error)
        counters = await device.counters() if Capability.COUNTERS in target.capabilities else None
        judgement = judge(stage, scenario, counters)
        return ScenarioOutcome(failure, judgement, latencies_of(stage.said, target.machine.node_id))


async def stop_fleet(simulation: BusRun[Any]) -> None:
    """End every controller of a simulated fleet; what it has begun to write is written, and nothing new begins."""
    controllers = list(simulation.controllers.values())
    for controller in controllers:
        controller.holon.halted = controller.holon.halted or "the test is over"
        await controller.stop()
    for _ in range(MOST_WRITES):
        if all(controller.is_idle for controller in controllers):
            break
        await asyncio.sleep(WRITE_US / 1e6)


async def _open(simulation: BusRun[Any], target: Target, directory: Path) -> Device:
    if target.kind is TargetKind.SIMULATED:
        return SimulatedDevice(simulation, target.machine)
    if target.kind is TargetKind.BOARD:
        board = BoardDevice(simulation, target.machine, target.resources)
        await board.open()
        return board
    process = ProcessDevice(simulation, target.machine, directory)
    await process.open()
    return process

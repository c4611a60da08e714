"""What a person does at an operator's station: a node of its own on the fleet bus, above all machines."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from bus_sim.faults.injection import Injection
from bus_sim.run import BusRun
from onboard.contract.codes import Reason
from onboard.contract.messages import Blocked, Clear, EmergencyStop, Message
from onboard.core.site import Segment
from onboard.operate.commands import CommandRequest, maker_of
from onboard.operate.names import OperateError
from onboard.operate.order import NOT_CONFIRMED, OperatorCommand
from onboard.operate.station import OperatorStation

#: The station's node-ID: 251 to 255 are kept for gateways and tools (dbc/fleet.dbc).
STATION = 251
#: The node-ID of whoever says one word only: presses the button for an emergency stop, marks a segment.
BUTTON = 252
#: So long after its word its seal is through, s: a gate waits for the answers of all machines first.
GOES_AFTER_S = 2.0
#: Whoever could not let a machine go, as it was off or held by more than that, tries again after this, us.
AGAIN_US = 30_000_000


def blocked(simulation: BusRun[Any], injection: Injection) -> None:
    """Somebody says that a segment cannot be passed, and some time later that it can."""
    where = Segment(injection.count("track"), injection.count("index"))
    _say(simulation, Blocked(STATION, *where, Reason.OPERATOR))
    if injection.number("for_s"):
        clear = partial(_say, simulation, Clear(STATION, *where, Reason.OPERATOR))
        simulation.plant.timers.call_at(injection.until_us, clear)


def emergency_stop(simulation: BusRun[Any], _: Injection) -> None:
    """Somebody presses the button: every machine holds for half a minute, or until an operator lets it go on."""
    _say(simulation, EmergencyStop(STATION, Reason.OPERATOR))


def held(simulation: BusRun[Any], injection: Injection) -> None:
    """A person holds a machine, and lets it go some time later, again and again until it says that it goes on."""

    def stands(_: int | None) -> None:
        then_us = max(injection.until_us, simulation.loop.now_us())
        simulation.plant.timers.call_at(then_us, partial(_let_go, simulation, injection.target))

    give(simulation, CommandRequest("hold", machine=injection.target), stands if injection.number("for_s") else _done)


def _done(_: int | None) -> None:
    """Nothing follows."""


def _let_go(simulation: BusRun[Any], name: str) -> None:
    def ended(status: int | None) -> None:
        # None: it could not be given, as to a machine that an emergency stop holds too.
        if status in (NOT_CONFIRMED, None):
            again_us = simulation.loop.now_us() + AGAIN_US
            simulation.plant.timers.call_at(again_us, partial(_let_go, simulation, name))

    give(simulation, CommandRequest("release", machine=name), ended)


def operate(simulation: BusRun[Any], injection: Injection) -> None:
    """A person gives a command of ``onboard operate`` and answers yes; what it says is in the run's telemetry."""
    give(simulation, wish_of(injection))


def give(simulation: BusRun[Any], asked: CommandRequest, ended: Callable[[int | None], None] = _done) -> None:
    """The same of a command in its own words; ``ended`` is told its exit status, None where it could not be given."""

    def over(done: "asyncio.Task[int | None]") -> None:
        # An exception in it is a mistake of this program: it ends the run.
        if not done.cancelled():
            ended(done.result())

    simulation.loop.create_task(_operate(simulation, asked)).add_done_callback(over)


async def _operate(simulation: BusRun[Any], asked: CommandRequest) -> int | None:
    if not simulation.seals.are_used:
        return await _speak(simulation, asked, None)
    async with simulation.station:
        return await _speak(simulation, asked, STATION)


async def _speak(simulation: BusRun[Any], asked: CommandRequest, node: int | None) -> int | None:
    loop, site = simulation.loop, simulation.site
    who = f"operator {asked.command} {next(simulation.visitors)}"
    bus = simulation.fleet.attach(who, None) if node is None else simulation.tool_bus(who, node)

    def tell(line: str) -> None:
        simulation.log.event(loop.now_us(), "operator", line)

    station = OperatorStation(site, simulation.codecs.fleet, bus, tell)
    try:
        make = maker_of(site, asked, seed=loop.now_us() // 1_000_000)
        return await station.operate(make, node, _agrees)
    except OperateError as error:
        tell(str(error))
        return None
    finally:
        await bus.close()


async def _agrees(_: OperatorCommand) -> bool:
    return True


def wish_of(injection: Injection) -> CommandRequest:
    """The command that a fault of kind ``operate`` means."""
    do, seconds = injection.text("do"), injection.number("for_s")
    segment = f"p({injection.count('track')},{injection.count('index')})"
    is_absent = injection.text("absent") == "yes"
    return CommandRequest(
        do,
        machine=injection.text("target"),
        segment=segment,
        of=injection.text("target") if do == "go" else "",
        absent=injection.text("target") if is_absent else "",
        body=(injection.text("body").replace(";", ",") or segment,),
        for_us=round(seconds * 1e6) if do == "stop" else None,
    )


def _say(simulation: BusRun[Any], message: Message) -> None:
    """One word, and who said it goes away again.

    Where a site has seals that is not the station: two that speak under one node-ID at a time take each other's answers
    for false seals.
    """
    node = BUTTON if simulation.seals.are_used else STATION
    bus = simulation.tool_bus(f"operator {next(simulation.visitors)}", node)
    for frame in simulation.codecs.fleet.encode(replace(message, sender=node)):
        bus.send(frame)
    if simulation.seals.are_used:
        simulation.loop.call_later(GOES_AFTER_S, lambda: simulation.loop.create_task(bus.close()))

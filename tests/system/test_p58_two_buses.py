"""One controller, one test body, three buses (row P58): only what the shell is plugged into differs.

In the simulator, in virtual time; on python-can; and on a served bus behind a socket, both at the pace of the clock.
"""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from itertools import count
from typing import TypeVar

import pytest

from bus_sim import virtual_time
from bus_sim.can.medium import Medium
from bus_sim.journal import SimulatedJournal
from bus_sim.run import EventLog, NoWatchdog
from bus_sim.serve.socketcand import SocketcandServer
from bus_sim.virtual_time import LoopClock
from onboard.contract.codes import DeskInput, DoorAction, DoorName, DoorPosition, LightColour, Reason, TaskPhase
from onboard.contract.messages import (
    Award,
    BayState,
    Bid,
    CallForProposals,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    LightOrder,
    Message,
    Reference,
    TaskReport,
)
from onboard.controller.shell import Controller, Ports
from onboard.core.frame import Frame
from onboard.holon.holon import Holon
from onboard.io.open_bus import BusSettings, open_bus
from onboard.ports.bus import Bus
from onboard.systems.registry import factory_for
from onboard.wire.codec import Codec, device_codec, fleet_codec
from onboard.wire.decoder import Decoder
from tests.sites import one_floor
from tests.tools import DEADLINE_S

M = TypeVar("M", bound=Message)

#: Joins a bus by its name: ``fleet`` or ``device``.
Join = Callable[[str], Awaitable[Bus]]
#: What was said on the fleet bus and on the device bus.
Stories = tuple[list[str], list[str]]
BAY, ROBOT = 1, 11


class Ears:
    """A node of one bus that speaks in messages and writes down, in words, what the controller orders and says."""

    def __init__(self, bus: Bus, codec: Codec) -> None:
        self.story: list[str] = []
        self.heard: list[Message] = []
        self.answer: Callable[[Message], Message | None] = lambda _: None
        self._bus, self._codec, self._decoder = bus, codec, Decoder(codec)
        self._news = asyncio.Event()
        bus.subscribe(self._on_frame)

    def say(self, message: Message) -> None:
        for frame in self._codec.encode(message):
            assert self._bus.send(frame)

    async def until(self, kind: type[M], fits: Callable[[M], bool] = lambda _: True) -> M:
        async with asyncio.timeout(DEADLINE_S):
            while True:
                for message in self.heard:
                    if isinstance(message, kind) and fits(message):
                        return message
                self._news.clear()
                await self._news.wait()

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        message = self._decoder.feed(frame, time_us)
        if message is None:
            return
        self.heard.append(message)
        self._news.set()
        told = in_words(message)
        if told and told not in self.story[-1:]:
            self.story.append(told)
        answer = self.answer(message)
        if answer is not None:
            self.say(answer)


def in_words(message: Message) -> str:
    """What does not depend on clock and pace; nothing for what is said by the clock."""
    match message:
        case DoorOrder():
            return f"{message.door.name} {message.action.name}"
        case LightOrder():
            return f"light {message.colour.name}"
        case DeskOrder():
            return f"desk {message.text.name} {message.car.number}"
        case CallForProposals():
            return f"call {message.operation.name} from {message.from_station:04X} car {message.car.number}"
        case Award() if message.winner:
            # A machine that is held up for a second of real time opens its call again: that is no other story.
            return f"award {message.result.name} to {message.winner}"
    return ""


class Doors:
    """Doors that are where they are ordered to be at once."""

    def __init__(self) -> None:
        self.at = {DoorName.INPUT: DoorPosition.LOCKED, DoorName.OUTPUT: DoorPosition.LOCKED}

    def state(self) -> DoorState:
        return DoorState(BAY, self.at[DoorName.INPUT], self.at[DoorName.OUTPUT], LightColour.RED)

    def obey(self, order: Message) -> Message | None:
        if not isinstance(order, DoorOrder):
            return None
        self.at[order.door] = DoorPosition.OPEN if order.action is DoorAction.OPEN else DoorPosition.LOCKED
        return self.state()


def bid(call: Message) -> Message | None:
    """What the robot answers to each call."""
    if not isinstance(call, CallForProposals):
        return None
    return Bid(ROBOT, BAY, call.call, (call.deadline_ms + 60_000) % 2**32, 0)


async def a_car_is_left(join: Join) -> Stories:
    """The body: a bay's controller from power-up to the award; robot, devices and customer are the test's words."""
    site, doors = one_floor(), Doors()
    fleet, device = Ears(await join("fleet"), fleet_codec()), Ears(await join("device"), device_codec())
    device.answer, fleet.answer = doors.obey, bid
    machine = site.machines[BAY]
    ports = Ports(await join("fleet"), await join("device"), SimulatedJournal(), EventLog(), NoWatchdog())
    controller = Controller(Holon(site, machine, factory_for(site, machine.kind)), ports, fleet_codec(), device_codec())
    controller.start()
    device.say(doors.state())
    device.say(BayState(BAY, 0, 0, 0, 0, False, False, 0))
    await device.until(LightOrder, lambda m: m.colour is LightColour.GREEN)
    device.say(BayState(BAY, 1_400, 4_300, 1_500, 2_700, False, False, 0))
    device.say(DeskEvent(BAY, 1, DeskInput.KEY, Reference(0, 0)))
    award = await fleet.until(Award, lambda m: m.winner == ROBOT)
    fleet.say(TaskReport(ROBOT, award.task, TaskPhase.AWARDED, site.places[0].number, Reason.NONE))
    await controller.stop()
    return fleet.story, device.story


_numbers = count()


async def on_the_simulated_bus() -> Stories:
    clock = LoopClock(asyncio.get_running_loop())
    media = {name: Medium(clock, name=name) for name in ("fleet", "device")}
    joined = count()

    async def join(name: str) -> Bus:
        return media[name].attach(f"node {next(joined)}")

    return await a_car_is_left(join)


async def outside(settings: Callable[[str], BusSettings]) -> Stories:
    buses: list[Bus] = []

    async def join(name: str) -> Bus:
        buses.append(await open_bus(settings(name)))
        return buses[-1]

    try:
        return await a_car_is_left(join)
    finally:
        for bus in buses:
            await bus.close()


async def on_python_can() -> Stories:
    run = next(_numbers)
    return await outside(lambda name: BusSettings("virtual", f"p58-{name}-{run}"))


async def on_a_served_bus() -> Stories:
    clock = LoopClock(asyncio.get_running_loop())
    media = {name: Medium(clock, name=name) for name in ("fleet", "device")}
    server = SocketcandServer(lambda channel, name: media[channel].attach(name), int, port=0)
    port = await server.start()
    try:
        return await outside(lambda name: BusSettings("socketcand-asyncio", name, extra=(("port", port),)))
    finally:
        await server.close()


FLEET_STORY = ["call PARK from 0104 car 1", "award AWARDED to 11"]
DEVICE_STORY = ["OUTPUT CLOSE", "INPUT OPEN", "light GREEN", "desk TAKE_TICKET 1", "light RED", "INPUT CLOSE"]


@pytest.mark.parametrize(
    ("run", "play"),
    [
        (virtual_time.run, on_the_simulated_bus),
        (asyncio.run, on_python_can),
        (asyncio.run, on_a_served_bus),
    ],
    ids=["simulated", "python-can", "served"],
)
def test_p58_the_same_controller_tells_the_same_story_on_each_bus(
    run: Callable[[Coroutine[None, None, Stories]], Stories], play: Callable[[], Coroutine[None, None, Stories]]
) -> None:
    assert run(play()) == (FLEET_STORY, DEVICE_STORY)

"""Devices on a CAN bus: orders arrive as frames, states leave as frames, other machines' frames are passed over."""

import asyncio
from collections.abc import Iterator
from functools import partial

import pytest

from bus_sim.can.medium import Medium
from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import LoopTimers
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import LightColour
from onboard.contract.messages import LightOrder, Message, StateRequest
from onboard.core.frame import Frame
from onboard.ports.bus import BusHealth, FrameHandler
from onboard.wire.codec import device_codec
from onboard.wire.decoder import Decoder


class FullBus:
    """A bus whose transmit queue is full."""

    name = "full"

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        pass

    def send(self, frame: Frame) -> bool:
        return False

    def health(self) -> BusHealth:
        return BusHealth()

    async def close(self) -> None:
        pass


@pytest.fixture
def loop() -> Iterator[VirtualTimeLoop]:
    loop = VirtualTimeLoop()
    yield loop
    loop.close()


def keep(messages: list[Message], message: Message, _: int) -> None:
    messages.append(message)


def test_messages_cross_a_simulated_bus_and_only_the_own_machine_listens(loop: VirtualTimeLoop) -> None:
    medium = Medium(loop, bit_rate=500_000)
    codec = device_codec()
    heard: dict[int, list[Message]] = {1: [], 2: []}
    for node, messages in heard.items():
        link = BusDeviceLink(medium.attach(f"devices {node}", node), codec, Decoder(codec), node)
        link.subscribe(partial(keep, messages))
    controller = BusDeviceLink(medium.attach("controller", 1), codec, Decoder(codec), 1)
    order = LightOrder(1, LightColour.GREEN)
    loop.call_at(0.001, controller.send, order)
    loop.run_until_complete(asyncio.sleep(0.01))
    assert heard == {1: [order], 2: []}


def test_a_full_queue_is_counted_and_nothing_raised() -> None:
    codec = device_codec()
    link = BusDeviceLink(FullBus(), codec, Decoder(codec), 1)
    link.send(LightOrder(1, LightColour.RED))
    assert link.send_refused == 1


def test_loop_timers_fire_at_the_microsecond_asked_for(loop: VirtualTimeLoop) -> None:
    timers = LoopTimers(loop)
    fired: list[tuple[int, int]] = []

    def fire(when_us: int) -> None:
        fired.append((when_us, timers.now_us()))

    for when_us in (1, 333_333, 1_000_001, 86_399_999_999):
        timers.call_at(when_us, partial(fire, when_us))
    timers.call_at(500, lambda: fired.append((0, 0))).cancel()
    loop.run_until_complete(asyncio.sleep(86_400))
    assert fired == [(t, t) for t in (1, 333_333, 1_000_001, 86_399_999_999)]


def test_a_device_that_is_asked_answers_also_while_no_order_reaches_it(loop: VirtualTimeLoop) -> None:
    medium = Medium(loop, bit_rate=500_000)
    codec = device_codec()
    asked: list[int] = []
    for node in (1, 2):
        link = BusDeviceLink(medium.attach(f"devices {node}", node), codec, Decoder(codec), node)
        link.incoming.append(lambda _: None)
        link.answer(partial(asked.append, node))
    controller = BusDeviceLink(medium.attach("controller", 1), codec, Decoder(codec), 1)
    loop.call_at(0.001, controller.send, StateRequest(1))
    loop.run_until_complete(asyncio.sleep(0.01))
    assert asked == [1]

"""An interface that is late, or gone and back: it is waited for, and nothing is ended by it."""

import asyncio
from collections.abc import Coroutine
from typing import Any

import pytest

from bus_sim.virtual_time import run
from onboard.core.frame import Frame
from onboard.io.lasting_bus import RETRY_S, LastingBus
from onboard.io.settings import BusOpenError, BusSettings
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler

CAN0 = BusSettings("socketcan", "can0")
FRAME = Frame(0x123, b"\1")


class Driver:
    """One opening of an interface."""

    def __init__(self) -> None:
        self.name = "can0"
        self.sent: list[Frame] = []
        self.closed = False
        self.handlers: list[FrameHandler] = []
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        self.handlers.append(on_frame)

    def send(self, frame: Frame) -> bool:
        self.sent.append(frame)
        return True

    def health(self) -> BusHealth:
        return BusHealth(sent=len(self.sent))

    async def wait_lost(self) -> str:
        return await self.lost

    async def close(self) -> None:
        self.closed = True


class Board:
    """Whether the interface is there, what was opened, and what a person was told."""

    def __init__(self) -> None:
        self.why_not: BusOpenError | None = BusOpenError("no such device", may_come=True)
        self.looks = 0
        self.opened: list[Driver] = []
        self.told: list[str] = []

    async def open(self, settings: BusSettings) -> Driver:
        assert settings == CAN0
        self.looks += 1
        if self.why_not is not None:
            raise self.why_not
        self.opened.append(Driver())
        return self.opened[-1]

    def bus(self, needs: LastingBus | None = None) -> LastingBus:
        return LastingBus(CAN0, self.told.append, needs=needs, opener=self.open)


def play(scene: Coroutine[Any, Any, None]) -> None:
    run(scene)


def test_a_late_interface_is_waited_for_and_told_once() -> None:
    async def scene() -> None:
        board = Board()
        bus = board.bus()
        starting = asyncio.create_task(bus.start())
        await asyncio.sleep(10 * RETRY_S)
        assert bus.is_away and not bus.send(FRAME) and bus.health().state is ErrorState.BUS_OFF
        assert board.told == ["waits for its bus: no such device"]
        assert board.looks >= 10
        board.why_not = None
        await starting
        assert bus.send(FRAME) and board.opened[0].sent == [FRAME]
        await bus.close()
        assert board.opened[0].closed

    play(scene())


def test_what_no_waiting_heals_is_told_at_once() -> None:
    async def scene() -> None:
        board = Board()
        board.why_not = BusOpenError("no such interface")
        with pytest.raises(BusOpenError, match="no such interface"):
            await board.bus().start()
        assert board.looks == 1

    play(scene())


def test_gone_and_back_it_goes_on_with_its_subscribers() -> None:
    async def scene() -> None:
        board = Board()
        board.why_not = None
        bus = board.bus()
        losses: list[int] = []
        bus.on_loss = lambda: losses.append(bus.losses)
        heard: list[Frame] = []
        await bus.start()
        bus.subscribe(lambda frame, _: heard.append(frame))
        for cycle in range(1, 4):
            board.why_not = BusOpenError("no such device", may_come=True)
            board.opened[-1].lost.set_result("network is down")
            await asyncio.sleep(5 * RETRY_S)
            assert [bus.is_away, board.opened[-1].closed] == [True, True] and losses == list(range(1, cycle + 1))
            board.why_not = None
            await asyncio.sleep(RETRY_S)
            assert not bus.is_away and bus.send(FRAME)
            board.opened[-1].handlers[0](FRAME, 0)
            assert len(heard) == cycle
        assert len(board.opened) == 4
        assert board.told[:3] == [
            "the bus is gone: network is down; the machine stands until it is back",
            "waits for its bus: no such device",
            "the bus socketcan:can0 is back",
        ]
        await bus.close()

    play(scene())


def test_drives_get_no_orders_from_a_machine_that_could_not_hear_a_stop() -> None:
    async def scene() -> None:
        fleet_board, device_board = Board(), Board()
        fleet_board.why_not = device_board.why_not = None
        fleet = fleet_board.bus()
        device = device_board.bus(needs=fleet)
        await fleet.start()
        await device.start()
        assert device.send(FRAME)
        fleet_board.why_not = BusOpenError("gone", may_come=True)
        fleet_board.opened[0].lost.set_result("gone")
        await asyncio.sleep(RETRY_S)
        assert not device.send(FRAME) and device_board.opened[0].sent == [FRAME]
        fleet_board.why_not = None
        await asyncio.sleep(2 * RETRY_S)
        assert device.send(FRAME)
        await fleet.close()
        await device.close()

    play(scene())


def test_closing_while_it_is_away_ends_the_looking() -> None:
    async def scene() -> None:
        board = Board()
        board.why_not = None
        bus = board.bus()
        await bus.start()
        board.why_not = BusOpenError("gone", may_come=True)
        board.opened[0].lost.set_result("gone")
        await asyncio.sleep(RETRY_S)
        await bus.close()
        looks = board.looks
        await asyncio.sleep(10 * RETRY_S)
        assert board.looks == looks

    play(scene())

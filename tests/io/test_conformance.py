"""The conformance body of ``ports.Bus`` on buses to the world outside."""

import asyncio
import itertools
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence

import pytest

from bus_sim.can.medium import Medium
from bus_sim.serve.socketcand import SocketcandServer
from bus_sim.virtual_time import LoopClock
from onboard.core.frame import Frame
from onboard.io.open_bus import BusSettings, open_bus
from onboard.ports.bus import Bus, BusHealth, FrameHandler
from tests.can import conformance
from tests.can.conformance import CONFORMANCE, FILTER_MASK, FILTER_VALUE
from tests.io.hub import until

Check = Callable[[conformance.Pair], Awaitable[None]]
_numbers = itertools.count()


class Watched:
    """A bus whose accepted frames are known, so that a test can wait for each of them."""

    def __init__(self, bus: Bus, filtered: bool) -> None:
        self.name = bus.name
        self.bus = bus
        self.filtered = filtered
        self.accepted: list[Frame] = []
        self.is_open = True

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        self.bus.subscribe(on_frame, on_sent)

    def send(self, frame: Frame) -> bool:
        taken = self.bus.send(frame)
        self.accepted += [frame] * taken
        return taken

    def health(self) -> BusHealth:
        return self.bus.health()

    async def close(self) -> None:
        self.is_open = False
        await self.bus.close()

    def hears(self, frame: Frame) -> bool:
        return not self.filtered or (frame.is_extended and frame.arbitration_id & FILTER_MASK == FILTER_VALUE)


class OutsidePair:
    """Three or four nodes of one bus."""

    def __init__(self, buses: Sequence[Bus], filtered: Bus | None = None) -> None:
        """The first three of ``buses``, and one with the filter of the body."""
        self.nodes = [Watched(bus, False) for bus in buses]
        self.a: Bus = self.nodes[0]
        self.b: Bus = self.nodes[1]
        self.c: Bus | None = self.nodes[2]
        self.filtered: Bus | None = None
        self.send_capacity: int | None = None
        if filtered is not None:
            self.nodes.append(Watched(filtered, True))
            self.filtered = self.nodes[-1]

    async def settle(self) -> None:
        await until(lambda: all(self._is_settled(node) for node in self.nodes if node.is_open))
        for _ in range(5):
            await asyncio.sleep(0)

    def _is_settled(self, node: Watched) -> bool:
        others = [frame for other in self.nodes if other is not node for frame in other.accepted if node.hears(frame)]
        health = node.health()
        return health.sent >= len(node.accepted) and health.received >= len(others)

    async def close(self) -> None:
        for node in self.nodes:
            await node.close()


@pytest.fixture
async def virtual() -> AsyncIterator[OutsidePair]:
    """python-can's virtual interface through ``onboard.io.pycan``."""
    channel = f"conformance-{next(_numbers)}"
    plain = BusSettings("virtual", channel)
    accepts = [{"can_id": FILTER_VALUE, "can_mask": FILTER_MASK, "extended": True}]
    buses = [await open_bus(plain) for _ in range(3)]
    pair = OutsidePair(buses, await open_bus(BusSettings("virtual", channel, extra=(("can_filters", accepts),))))
    yield pair
    await pair.close()


@pytest.fixture
async def served() -> AsyncIterator[OutsidePair]:
    """A simulated CAN bus at the pace of the clock, behind its server, and our own client."""
    medium = Medium(LoopClock(asyncio.get_running_loop()))
    server = SocketcandServer(lambda _, name: medium.attach(name), int, port=0)
    settings = BusSettings("socketcand-asyncio", "fleet", extra=(("port", await server.start()),))
    pair = OutsidePair([await open_bus(settings) for _ in range(3)])
    yield pair
    await pair.close()
    await server.close()


#: Left out, for the technology has no such thing: the virtual interface has no bound that could be met.
VIRTUAL = [check for check in CONFORMANCE if check is not conformance.a_full_queue_refuses]
#: The protocol has neither remote frames nor filters, and TCP takes as much as the kernel likes.
SERVED = [
    check
    for check in VIRTUAL
    if check not in (conformance.remote_frames_arrive, conformance.filters_let_pass_what_they_say)
]


@pytest.mark.parametrize("check", VIRTUAL, ids=lambda check: check.__name__)
async def test_python_can_conforms(check: Check, virtual: OutsidePair) -> None:
    await check(virtual)


@pytest.mark.parametrize("check", SERVED, ids=lambda check: check.__name__)
async def test_a_served_bus_conforms(check: Check, served: OutsidePair) -> None:
    await check(served)

"""A bus in memory, without time or arbitration, and a node's ears: what tests of real interfaces stand on."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.core.frame import Frame
from onboard.ports.bus import BusHealth, FrameHandler
from tests.tools import DEADLINE_S


@dataclass
class HubNode:
    """One node of a ``Hub``."""

    name: str
    hub: "Hub"
    refuse: bool = False
    handlers: list[FrameHandler] = field(default_factory=list)

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        self.handlers.append(on_frame)

    def send(self, frame: Frame) -> bool:
        if self.refuse or self not in self.hub.nodes:
            return False
        for node in self.hub.nodes:
            if node is not self:
                for handler in node.handlers:
                    asyncio.get_running_loop().call_soon(handler, frame, self.hub.time_us)
        return True

    def health(self) -> BusHealth:
        return BusHealth()

    async def close(self) -> None:
        self.hub.nodes.remove(self)
        self.hub.changed.set()


class Hub:
    """A bus; ``time_us`` is the loop time that its frames carry."""

    def __init__(self) -> None:
        self.nodes: list[HubNode] = []
        self.time_us = 0
        self.changed = asyncio.Event()

    def attach(self, name: str) -> HubNode:
        node = HubNode(name, self)
        self.nodes.append(node)
        self.changed.set()
        return node


class Ears:
    """Collects frames and lets a test wait for them."""

    def __init__(self) -> None:
        self.frames: asyncio.Queue[Frame] = asyncio.Queue()
        self.sent: asyncio.Queue[Frame] = asyncio.Queue()
        self.times_us: list[int] = []

    def on_frame(self, frame: Frame, time_us: int) -> None:
        self.times_us.append(time_us)
        self.frames.put_nowait(frame)

    def on_sent(self, frame: Frame, time_us: int) -> None:
        self.sent.put_nowait(frame)

    async def hear(self, count: int) -> list[Frame]:
        """The next ``count`` frames."""
        async with asyncio.timeout(DEADLINE_S):
            return [await self.frames.get() for _ in range(count)]

    async def hear_sent(self, count: int) -> list[Frame]:
        """The next ``count`` confirmations."""
        async with asyncio.timeout(DEADLINE_S):
            return [await self.sent.get() for _ in range(count)]


async def until(condition: Callable[[], bool]) -> None:
    """Let the loop turn until ``condition`` holds, within the deadline."""
    async with asyncio.timeout(DEADLINE_S):
        while not condition():  # noqa: ASYNC110 - conditions of foreign code have no event
            await asyncio.sleep(0.001)

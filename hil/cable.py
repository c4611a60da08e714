"""A plug between a node and a simulated bus: pulled, frames wait in the node's queue as in a CAN controller's."""

from collections import deque
from collections.abc import Callable

from bus_sim.can.node import SimulatedBus
from onboard.core.frame import Frame
from onboard.ports.bus import BusHealth, FrameHandler

#: Frames that wait while the plug is out, as many as a Linux interface is told to hold (``txqueuelen``).
QUEUE_LIMIT = 1000


class Cable:
    """``ports.Bus`` for one node. ``attach`` makes a new node of the bus each time the plug is put in.

    What was queued while the plug was out leaves when it is back, late, as with SocketCAN.
    """

    def __init__(self, attach: Callable[[], SimulatedBus]) -> None:
        self._attach = attach
        self.node: SimulatedBus | None = attach()
        self.name = self.node.name
        self._before: list[BusHealth] = []
        self._handlers: list[tuple[FrameHandler, FrameHandler | None]] = []
        self._waiting: deque[Frame] = deque()
        self._refused = 0
        self._closed = False

    # --- ports.Bus ---------------------------------------------------------------------------------------------

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """Also for each later node: handlers are handed on whenever the plug is put in."""
        self._handlers.append((on_frame, on_sent))
        if self.node is not None:
            self.node.subscribe(on_frame, on_sent)

    def send(self, frame: Frame) -> bool:
        """Queue in the node, or here while the plug is out; False, and counted, beyond ``QUEUE_LIMIT`` frames."""
        if self.node is not None:
            return self.node.send(frame)
        if self._closed or len(self._waiting) >= QUEUE_LIMIT:
            self._refused += 1
            return False
        self._waiting.append(frame)
        return True

    def health(self) -> BusHealth:
        """See ``Bus``; sums over all times that the plug was in, error counters of the present one."""
        now = self.node.health() if self.node is not None else BusHealth()
        lives = [*self._before, now]
        return BusHealth(
            now.state,
            now.tec,
            now.rec,
            sum(life.sent for life in lives),
            sum(life.received for life in lives),
            sum(life.send_refused for life in lives) + self._refused,
            sum(life.receive_overflows for life in lives),
        )

    async def close(self) -> None:
        """Leave for good: a plug that is put in afterwards joins no bus."""
        self._closed = True
        if self.node is not None:
            await self.node.close()

    # --- the plug ----------------------------------------------------------------------------------------------

    def unplug(self) -> None:
        """Pull it, in the middle of a frame if need be."""
        node, self.node = self.node, None
        if node is not None:
            self._before.append(node.health())
            node.power_off()

    def plug(self) -> None:
        """Put it back; harmless where it is in, or the node has left for good."""
        if self.node is not None or self._closed:
            return
        self.node = self._attach()
        for on_frame, on_sent in self._handlers:
            self.node.subscribe(on_frame, on_sent)
        while self._waiting:
            self.node.send(self._waiting.popleft())

    def power_off(self) -> None:
        """The node is gone for good, and what waited with it."""
        self._waiting.clear()
        self.unplug()
        self._closed = True

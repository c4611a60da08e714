"""The shell around an order: one station on one fleet bus, real or simulated, on the running loop."""

import asyncio
from collections.abc import Awaitable, Callable

from onboard.contract.messages import Message
from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.operate.commands import LISTEN_BEATS, Maker
from onboard.operate.names import FIRST_TOOL, LAST_TOOL, OperateError
from onboard.operate.order import MISTAKE, NOT_CONFIRMED, OperatorCommand
from onboard.operate.park import Park
from onboard.ports.bus import Bus
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder

#: What was said last has so long to leave before the bus is closed, s: a burst of frames at 125 kbit/s.
LINGER_S = 0.2


class OperatorStation:
    """Hears a bus from its making on. ``tell`` is given every line for the person."""

    def __init__(self, site: Site, codec: Codec, bus: Bus, tell: Callable[[str], None]) -> None:
        self.park = Park(site)
        self.node = 0
        self._codec, self._bus, self._tell = codec, bus, tell
        self._decoder = Decoder(codec, site.machines)
        self._loop = asyncio.get_running_loop()
        self._order: OperatorCommand | None = None
        self._news = asyncio.Event()
        self._is_interrupted = False
        self._is_lost = ""
        self._told: set[str] = set()
        #: Node-IDs of all frames of this contract's form that were heard.
        self._nodes: set[int] = set()
        bus.subscribe(self._on_frame)

    def now_us(self) -> int:
        """Time of the asyncio loop in whole us."""
        return round(self._loop.time() * 1_000_000)

    async def listen(self, for_us: int) -> bool:
        """Hear what is said for so long; False where it was interrupted or the bus is gone."""
        end_us = self.now_us() + for_us
        while (rest_us := end_us - self.now_us()) > 0 and not self._is_interrupted and not self._is_lost:
            await self._wait(rest_us)
        return not self._is_interrupted and not self._is_lost

    def speak_as(self, node: int | None) -> int:
        """Choose the node-ID: ``node``, or the lowest of a tool's that was not heard. Raises ``OperateError``."""
        free = [one for one in range(FIRST_TOOL, LAST_TOOL + 1) if one not in self._nodes]
        remedy = f"give another, such as --node {free[0]}" if free else "end one of the tools"
        if node is not None and node in self._nodes:
            raise OperateError(f"--node {node}: somebody speaks under it on this bus; {remedy}")
        if not free:
            raise OperateError("all node-IDs of tools, 251 to 255, are heard on this bus; end one of the tools")
        self.node = free[0] if node is None else node
        return self.node

    async def operate(self, make: Maker, node: int | None, agrees: Callable[[OperatorCommand], Awaitable[bool]]) -> int:
        """Look, show, ask, do: the exit status. ``node`` as in ``speak_as``. Raises ``OperateError``.

        What is urgent is said at once, under ``node`` or the first of a tool's.
        """
        order = make(self.park, FIRST_TOOL if node is None else node)
        if order.is_urgent:
            self.node = order.node
        elif not order.is_silent:
            beats_us = LISTEN_BEATS * self.park.site.timing.heartbeat_us
            self._tell(f"listening for {beats_us / 1e6:g} s")
            if not await self.listen(beats_us):
                return NOT_CONFIRMED
            order = make(self.park, self.speak_as(node))
            for line in order.preview(self.now_us()):
                self._tell(line)
        if order.question and not await agrees(order):
            return MISTAKE
        return await self.carry_out(order, agrees)

    async def carry_out(self, order: OperatorCommand, agrees: Callable[[OperatorCommand], Awaitable[bool]]) -> int:
        """Do it; the exit status. Lines are told as they come; while a question is open the order speaks on."""
        self._order = order
        order.begin(self.now_us())
        asked: asyncio.Future[bool] | None = None
        while order.status is None:
            self._do(order)
            if order.has_question and asked is None:
                asked = asyncio.ensure_future(agrees(order))
                asked.add_done_callback(lambda _: self._news.set())
            if asked is not None and asked.done():
                order.answered(self.now_us(), agrees=asked.result())
            due_us = order.next_wake()
            if order.status is None:
                await self._wait(None if due_us is None else due_us - self.now_us())
        if asked is not None:
            asked.cancel()
        self._show(order)
        self._order = None
        await asyncio.sleep(LINGER_S)
        return order.status

    def interrupt(self) -> None:
        """A person has pressed Ctrl-C: the order ends as its ``interrupt`` says."""
        self._is_interrupted = True
        self._news.set()

    async def interrupted(self) -> None:
        """Return once a person ends it, or the bus is gone."""
        while not self._is_interrupted and not self._is_lost:
            await self._wait(None)

    def lose(self, why: str) -> None:
        """The bus is gone for good; ``why`` is told to the person."""
        self._is_lost = why
        self._news.set()

    # --- inner works -------------------------------------------------------------------------------------------

    def _do(self, order: OperatorCommand) -> None:
        """One turn: what is due is said, what is new is told."""
        now_us = self.now_us()
        if self._is_lost:
            order.tell(f"the bus is gone: {self._is_lost}")
            order.status = NOT_CONFIRMED
        elif self._is_interrupted:
            self._send(order.interrupt(now_us))
        elif (due_us := order.next_wake()) is not None and due_us <= now_us:
            self._send(order.wake(now_us))
        self._show(order)

    def _send(self, messages: list[Message]) -> None:
        for message in messages:
            for frame in self._codec.encode(message):
                if not self._bus.send(frame):
                    self._tell_once("the bus takes no frames: is anybody else on it, at this bit rate?")

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        if frame.is_extended:
            self._nodes.add(frame.arbitration_id & 0xFF)
        message = self._decoder.feed(frame, time_us)
        if message is None:
            return
        if message.sender == self.node:
            self._tell_once(f"somebody else speaks under node-ID {self.node} as well; end that, or give another --node")
            return
        for word in singles(message):
            self.park.feed(word, time_us)
            if self._order is not None:
                self._order.feed(word, time_us)
                self._news.set()

    async def _wait(self, rest_us: int | None) -> None:
        """Until something is heard that matters, or for so long."""
        timer = None if rest_us is None else self._loop.call_later(max(0, rest_us) / 1e6, self._news.set)
        await self._news.wait()
        self._news.clear()
        if timer is not None:
            timer.cancel()

    def _show(self, order: OperatorCommand) -> None:
        for line in order.news():
            self._tell(line)

    def _tell_once(self, line: str) -> None:
        if line not in self._told:
            self._told.add(line)
            self._tell(line)

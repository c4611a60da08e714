"""Both buses of one machine, heard as messages; and what one says there as its controller would."""

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import TypeVar

from hil.notice import Notice
from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.ports.bus import Bus
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder

M = TypeVar("M", bound=Message)


class CommissionListener:
    """One bus. ``heard`` keeps every message with its loop time, us; ``senders`` counts frames by node-ID."""

    def __init__(self, bus: Bus, codec: Codec) -> None:
        self.bus = bus
        self.heard: list[tuple[int, Message]] = []
        self.senders: Counter[int] = Counter()
        self.foreign_frames = 0
        self.error_frames = 0
        self.notice = Notice()
        self._codec = codec
        self._decoder = Decoder(codec)
        bus.subscribe(self._on_frame)

    @property
    def frames(self) -> int:
        """Frames of this contract that were heard."""
        return sum(self.senders.values())

    def mark(self) -> int:
        """The present, as a place in ``heard``."""
        return len(self.heard)

    def say(self, message: Message) -> None:
        """Send a message as its controller would, in as many frames as it needs."""
        for frame in self._codec.encode(message):
            self.bus.send(frame)

    async def first(
        self, kind: type[M], within_s: float, where: Callable[[M], bool] = lambda _: True, since: int = 0
    ) -> M | None:
        """The first message of a kind that fits, heard since a mark or coming; None after ``within_s``."""

        def look() -> M | None:
            found = (message for _, message in self.heard[since:] if isinstance(message, kind) and where(message))
            return next(found, None)

        return await self.notice.until(look, within_s)

    async def listen(self, for_s: float) -> None:
        """Let time pass without a word."""
        await asyncio.sleep(for_s)

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        if frame.is_error:
            self.error_frames += 1
            return
        if self._codec.name_of(frame) is None:
            self.foreign_frames += 1
            return
        # The lowest byte of an identifier is the sender's node-ID.
        self.senders[frame.arbitration_id & 0xFF] += 1
        message = self._decoder.feed(frame, time_us)
        if message is not None:
            self.heard.append((time_us, message))
            self.notice.tell()

"""Sources that are no simulator of ours: a live bus that is only listened to, and a recorded log with a slider."""

import asyncio
from collections.abc import Mapping
from typing import Any

from onboard.core.frame import Frame
from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.trace.candump_reader import CandumpReader
from onboard.web.app import CommandError, number
from onboard.web.picture import LivePicture
from onboard.wire.codec import Codecs
from onboard.wire.decoder import Decoder

#: Speed of a log unless told otherwise, and the highest, log seconds a second.
LOG_PACE, MOST_PACE = 10.0, 1_000.0
#: The log's clock moves on in steps of this, wall s.
TICK_S = 0.05


class LiveSource:
    """A bus as it is: listened to, never spoken on."""

    mode = "live"

    def __init__(self, site: Site, codecs: Codecs) -> None:
        self.picture = LivePicture(site)
        self._decoder = Decoder(codecs.fleet)
        self._loop = asyncio.get_running_loop()

    def on_frame(self, frame: Frame, time_us: int) -> None:
        """One frame of the fleet bus, at a time of the loop."""
        self.picture.count_frame()
        message = self._decoder.feed(frame, time_us)
        if message is not None:
            self.picture.feed(message, time_us)

    def layout(self) -> dict[str, Any]:
        """As in the port."""
        return self.picture.layout()

    def snapshot(self) -> dict[str, Any]:
        """As in the port; the clock goes on between two frames."""
        self.picture.view.now_us = round(self._loop.time() * 1e6)
        return {**self.picture.snapshot(), "pace": 1}

    def figures(self) -> dict[str, Any]:
        """As in the port."""
        return self.picture.figures()

    async def command(self, name: str, arguments: Mapping[str, Any]) -> str:
        """Nothing is done to a bus that is not simulated."""
        raise CommandError(f"{name}: this bus is not simulated; the page only listens")

    async def sleep(self, seconds: float) -> None:
        """As in the port."""
        await asyncio.sleep(seconds)


class LogSource:
    """A recorded log, played from its beginning; ``lines`` as a binary file gives them.

    Raises ``ValueError`` where nothing in it is a message of the site.
    """

    mode = "log"

    def __init__(self, site: Site, codecs: Codecs, lines: list[bytes]) -> None:
        self._site = site
        self._messages = _read(lines, codecs)
        if not self._messages:
            raise ValueError("no message of the site's fleet bus is in it")
        self._first_us, self._last_us = self._messages[0][0], self._messages[-1][0]
        self._pace, self._paused = LOG_PACE, False
        self._next = 0
        self._now_us = self._first_us
        self.picture = LivePicture(site)

    async def play(self) -> None:
        """Move the log's clock on for ever."""
        while True:
            await asyncio.sleep(TICK_S)
            if not self._paused:
                self._to(min(self._last_us, self._now_us + round(TICK_S * self._pace * 1e6)))

    def _to(self, time_us: int) -> None:
        if time_us < self._now_us:
            self.picture, self._next = LivePicture(self._site), 0
        self._now_us = time_us
        while self._next < len(self._messages) and self._messages[self._next][0] <= time_us:
            at_us, node, message = self._messages[self._next]
            self._next += 1
            if node is None:
                self.picture.count_frame()
                self.picture.feed(message, at_us)
            else:
                self.picture.feed_device(node, message)

    def layout(self) -> dict[str, Any]:
        """As in the port."""
        return self.picture.layout()

    def snapshot(self) -> dict[str, Any]:
        """As in the port, with the log's span for the slider."""
        self.picture.view.now_us = self._now_us
        pace = 0.0 if self._paused or self._now_us >= self._last_us else self._pace
        return {**self.picture.snapshot(), "pace": pace, "span_us": [self._first_us, self._last_us]}

    def figures(self) -> dict[str, Any]:
        """As in the port."""
        return self.picture.figures()

    async def command(self, name: str, arguments: Mapping[str, Any]) -> str:
        """Pause, resume, speed and seek; a log takes nothing else."""
        match name:
            case "pause" | "resume":
                self._paused = name == "pause"
                return "paused" if self._paused else "goes on"
            case "speed":
                self._pace = number(arguments, "factor", 0.1, MOST_PACE)
                return f"{self._pace:g} times real time"
            case "seek":
                self._to(int(number(arguments, "to_us", self._first_us, self._last_us)))
                return "there"
        raise CommandError(f"{name}: a recorded log cannot be changed")

    async def sleep(self, seconds: float) -> None:
        """As in the port."""
        await asyncio.sleep(seconds)


def _read(lines: list[bytes], codecs: Codecs) -> list[tuple[int, int | None, Message]]:
    """All messages in order; with the node of the machine whose device bus it was, None for the fleet bus."""
    decoders: dict[str, tuple[Decoder, Decoder]] = {}
    found: list[tuple[int, int | None, Message]] = []
    last_us = 0
    for record in CandumpReader(lines):
        fleet, device = decoders.setdefault(record.channel, (Decoder(codecs.fleet), Decoder(codecs.device)))
        is_fleet = codecs.fleet.name_of(record.frame) is not None
        # A clock that was set back while the log was written must not hide what came after.
        last_us = max(last_us, record.time_us)
        message = (fleet if is_fleet else device).feed(record.frame, last_us)
        if message is not None:
            found.append((last_us, None if is_fleet else message.sender, message))
    return found

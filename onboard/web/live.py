"""Sources that are no simulator of ours: a live bus that is only listened to, and a recorded log with a slider."""

import asyncio
import time
from collections.abc import Mapping
from typing import Any

from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.seal.keys import Keys
from onboard.web.app import CommandError, number
from onboard.web.film import Film
from onboard.web.local_time import offset_s, zone_of
from onboard.web.picture import LivePicture, marks_of
from onboard.wire.codec import Codecs
from onboard.wire.decoder import Decoder

#: Speed of a log unless told otherwise, and the highest, log seconds a second.
LOG_PACE, MOST_PACE = 10.0, 1_000.0
#: The log's clock moves on in steps of this, wall s.
TICK_S = 0.05


class LiveSource:
    """A bus as it is: listened to, never spoken on."""

    mode = "live"

    def __init__(self, site: Site, codecs: Codecs, keys: Keys | None = None) -> None:
        """``keys``: of any node, for whose seals are right."""
        self.picture = LivePicture(site, marks_of(site, codecs, keys))
        self._codecs = codecs
        self._fleet, self._device = Decoder(codecs.fleet, site.machines), Decoder(codecs.device)
        self._loop = asyncio.get_running_loop()
        now_s = time.time()
        # The page tells the time of day: what the loop's clock lacks to it.
        self._zero_s = round(now_s) + offset_s(zone_of(site), round(now_s * 1e6)) - round(self._loop.time())

    def on_frame(self, frame: Frame, time_us: int) -> None:
        """One frame of the bus, at a time of the loop; a machine's devices may be on the same wires."""
        self.picture.count_frame(frame)
        is_fleet = self._codecs.fleet.name_of(frame) is not None
        self.picture.mark_frame(frame, time_us)
        message = (self._fleet if is_fleet else self._device).feed(frame, time_us)
        if message is None:
            return
        if is_fleet:
            for word in singles(message):
                self.picture.feed(word, time_us)
        else:
            self.picture.feed_device(message.sender, message, time_us)

    def layout(self) -> dict[str, Any]:
        """The drawing, without commands: a page may not move a live site."""
        return {**self.picture.layout(), "commands": []}

    def snapshot(self) -> dict[str, Any]:
        """As in the port; the clock goes on between two frames."""
        self.picture.view.now_us = round(self._loop.time() * 1e6)
        return {**self.picture.snapshot(), "pace": 1, "zero_s": self._zero_s}

    def figures(self) -> dict[str, Any]:
        """The indicators of what was heard so far."""
        return self.picture.figures()

    async def command(self, name: str, arguments: Mapping[str, Any]) -> str:
        """Nothing is done to a bus that is not simulated."""
        raise CommandError(f"{name}: this bus is not simulated; the page only listens")

    async def sleep(self, seconds: float) -> None:
        """Wait in real time, in s: the bus does not wait either."""
        await asyncio.sleep(seconds)


class LogSource:
    """A recorded log, played from its beginning, by the site's local time. ``film`` is read already.

    Raises ``WebError`` for a time zone that this computer does not know.
    """

    mode = "log"

    def __init__(self, film: Film) -> None:
        self._film = film
        self._zone = zone_of(film.site)
        self._first_us, self._last_us = film.first_us, film.last_us
        self._pace, self._paused = LOG_PACE, False
        self._now_us = self._first_us
        self.picture = film.show(self._now_us)

    async def play(self) -> None:
        """Move the log's clock on for ever."""
        while True:
            await asyncio.sleep(TICK_S)
            if not self._paused:
                self._to(min(self._last_us, self._now_us + round(TICK_S * self._pace * 1e6)))

    def _to(self, time_us: int) -> None:
        self._now_us = time_us
        self.picture = self._film.show(time_us)

    def layout(self) -> dict[str, Any]:
        """The drawing, with the commands of a player: pause and speed."""
        return {**self.picture.layout(), "commands": ["pause", "speed"]}

    def snapshot(self) -> dict[str, Any]:
        """As in the port, with the log's span for the slider."""
        pace = 0.0 if self._paused or self._now_us >= self._last_us else self._pace
        zero_s = offset_s(self._zone, self._now_us)
        return {**self.picture.snapshot(), "pace": pace, "zero_s": zero_s, "span_us": [self._first_us, self._last_us]}

    def figures(self) -> dict[str, Any]:
        """The indicators of the log up to the moment shown."""
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
        """Wait in real time, in s, whatever speed the log is played at."""
        await asyncio.sleep(seconds)

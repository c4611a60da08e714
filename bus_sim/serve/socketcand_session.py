"""One client of the socketcand server, from greeting to end."""

import asyncio
from collections import Counter
from collections.abc import Callable
from enum import Enum, auto

from onboard.core.frame import Frame
from onboard.io.socketcand_protocol import Splitter, format_frame, parse_send
from onboard.ports.bus import Bus

#: Bytes that may wait for a client; about 20,000 frames, seven seconds of a full bus at 500 kbit/s. A client that
#: reads more slowly is disconnected: it would only ever see the past.
WRITE_LIMIT = 1_000_000
#: python-can's client fails where its answer to ``rawmode`` comes together with a frame. Frames are held back for so
#: long, s, or until the client says something.
HOLD_S = 0.05
_HELP = "error this server serves open, rawmode, bcmmode, send and echo"


class Mode(Enum):
    """Modes of the protocol; ``BCM`` here only sends, for the broadcast manager's filters have no use on a laptop."""

    NO_BUS = auto()
    BCM = auto()
    RAW = auto()


class SocketcandSession(asyncio.Protocol):
    """A client's connection.

    Keys that it counts: ``clients``, ``opened``, ``refused`` (no such channel), ``listening`` (raw mode was entered),
    ``sent`` and ``send_refused`` (the node's queue was full), ``received``, ``remote_dropped`` (the protocol has no
    remote frames), ``malformed``, ``unknown_command``, ``too_slow``, ``foreign`` (whose first byte was of another
    protocol).
    """

    def __init__(
        self,
        name: str,
        join: Callable[[str, str], Bus | None],
        stamp: Callable[[int], int],
        counts: Counter[str],
        on_end: Callable[["SocketcandSession", Bus | None], None],
    ) -> None:
        self.name = name
        self._join = join
        self._stamp = stamp
        self._counts = counts
        self._on_end = on_end
        self._mode = Mode.NO_BUS
        self._bus: Bus | None = None
        self._splitter = Splitter()
        self._has_begun = False
        self._transport: asyncio.Transport | None = None
        self._held: list[bytes] | None = None
        self._holding: asyncio.TimerHandle | None = None

    def disconnect(self) -> None:
        """End the connection; what is queued for the client is still sent, as far as it goes at once."""
        if self._transport is not None:
            self._transport.close()
            if self._transport.get_write_buffer_size():
                self._transport.abort()

    # --- asyncio's side ----------------------------------------------------------------------------------------

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet the client with ``hi``; it has opened no bus yet."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._counts["clients"] += 1
        self._say("hi")

    def connection_lost(self, exc: Exception | None) -> None:
        """Give the client's node back, whoever ended the connection."""
        self._transport = None
        self._release()
        self._on_end(self, self._bus)

    def data_received(self, data: bytes) -> None:
        """Carry out every whole message; bytes that are none are counted and answered with an error.

        Who begins with something else than a message speaks another protocol, and is not listened to any further: a
        browser says its ``POST`` first, and what a page on the web makes it send after that is none of a person's.
        """
        if not self._has_begun:
            data = data.lstrip()
            self._has_begun = bool(data)
            if data and not data.startswith(b"<"):
                self._complain("foreign", "error not the socketcand protocol")
                self.disconnect()
                return
        garbage = self._splitter.garbage
        messages = self._splitter.feed(data)
        for _ in range(self._splitter.garbage - garbage):
            self._complain("malformed", "error not a message")
        if messages and self._held is not None:
            self._release()
        for message in messages:
            if self._transport is None or self._transport.is_closing():
                return
            self._on_message(message)

    # --- the protocol ------------------------------------------------------------------------------------------

    def _on_message(self, message: str) -> None:
        command, *words = message.split(" ")
        if self._mode is Mode.NO_BUS:
            if command == "open" and len(words) == 1:
                self._open(words[0])
            else:
                self._complain("unknown_command", _HELP)
        elif command == "send":
            self._send(words)
        elif message == "echo":
            self._say("echo")
        elif message == "rawmode":
            self._enter_raw_mode()
        elif message == "bcmmode":
            self._release()
            self._mode = Mode.BCM
            self._say("ok")
        else:
            self._complain("unknown_command", _HELP)

    def _open(self, channel: str) -> None:
        self._bus = self._join(channel, self.name)
        if self._bus is None:
            self._complain("refused", "error could not open bus; a server with a token wants open CHANNEL:TOKEN")
            self.disconnect()
            return
        self._counts["opened"] += 1
        self._mode = Mode.BCM
        self._bus.subscribe(self._on_frame)
        self._say("ok")

    def _enter_raw_mode(self) -> None:
        self._counts["listening"] += 1
        self._say("ok")
        self._mode = Mode.RAW
        self._held = []
        self._holding = asyncio.get_running_loop().call_later(HOLD_S, self._release)

    def _release(self) -> None:
        """End the pause after ``rawmode``."""
        held, self._held = self._held, None
        if self._holding is not None:
            self._holding.cancel()
        for report in held or ():
            self._write(report)

    def _send(self, words: list[str]) -> None:
        assert self._bus is not None
        try:
            frame = parse_send(words)
        except ValueError as error:
            self._complain("malformed", f"error {error}")
            return
        self._counts["sent" if self._bus.send(frame) else "send_refused"] += 1

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        if self._mode is not Mode.RAW or self._transport is None:
            return
        if frame.is_remote:
            self._counts["remote_dropped"] += 1
            return
        self._counts["received"] += 1
        report = format_frame(frame, self._stamp(time_us))
        if self._held is None:
            self._write(report)
        else:
            self._held.append(report)

    def _complain(self, count: str, message: str) -> None:
        self._counts[count] += 1
        self._say(message.replace("<", " ").replace(">", " "))

    def _say(self, message: str) -> None:
        self._write(f"< {message} >".encode("ascii", "replace"))

    def _write(self, message: bytes) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        self._transport.write(message)
        if self._transport.get_write_buffer_size() > WRITE_LIMIT:
            self._counts["too_slow"] += 1
            self._transport.abort()

"""``ports.Bus`` over the socketcand protocol, in asyncio: no thread, and it comes back when the server does."""

import asyncio
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

from onboard.core.frame import Frame
from onboard.io.kept_token import read_token
from onboard.io.owned_file import OwnedFileError
from onboard.io.settings import BusOpenError, BusSettings
from onboard.io.socketcand_protocol import DEFAULT_PORT, Splitter, format_send, parse_frame
from onboard.io.subscribers import Subscribers
from onboard.io.transmit import is_sendable
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler

#: Bytes that wait for the server; about 2,000 frames. Beyond that ``send`` refuses.
WRITE_LIMIT = 100_000
#: The first attempt to come back is made so long after the loss, s; each further one twice as long, up to the last.
BACKOFF_S, BACKOFF_MAX_S = 0.1, 5.0
#: How long connecting and the greeting may take, s.
CONNECT_TIMEOUT_S = 5.0


class SocketcandBus:
    """One node's connection to a channel of a socketcand server, in raw mode.

    While the server is away ``send`` refuses, ``health`` tells bus-off, and the connection is tried again with growing
    pauses: for ever, or until it has been away for ``give_up_s``. The protocol confirms nothing: ``on_sent`` is called
    once the frame is handed to TCP. Remote frames do not exist in the protocol and are refused.
    """

    def __init__(self, host: str, port: int, channel: str, give_up_s: float | None = None) -> None:
        """``start`` connects."""
        # What follows a colon is the server's token, and none of a log's.
        self.name = f"socketcand:{channel.partition(':')[0]}@{host}:{port}"
        self.counts: Counter[str] = Counter()
        self._loop = asyncio.get_running_loop()
        self._address = (host, port)
        self._channel = channel
        self._subscribers = Subscribers(self._loop, self.name)
        self._connection: _Connection | None = None
        self._returning: asyncio.Task[None] | None = None
        self._closed = False
        self._give_up_s = give_up_s
        self._lost: asyncio.Future[str] = self._loop.create_future()

    async def start(self) -> None:
        """Connect for the first time. Raises ``BusOpenError``."""
        try:
            await self._connect()
        except (OSError, TimeoutError) as error:
            why = "no answer" if isinstance(error, TimeoutError) else error.strerror or str(error)
            raise BusOpenError(
                f"{self.name}: {why}; is the server running, on this host and port, and does it have this channel?",
                may_come=True,
            ) from error

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """Handlers outlast a connection: they hear again once the server is back."""
        self._subscribers.add(on_frame, on_sent)

    def send(self, frame: Frame) -> bool:
        """Hand to TCP; False, and counted, while the server is away or ``WRITE_LIMIT`` bytes wait for it."""
        possible = is_sendable(frame) and not frame.is_remote
        if self._closed or not possible or self._connection is None or not self._connection.write(format_send(frame)):
            self.counts["send_refused"] += 1
            return False
        self._loop.call_soon(self._sent, frame)
        return True

    def health(self) -> BusHealth:
        """Bus-off while the server is away; error counters are 0, as the protocol does not carry them."""
        return BusHealth(
            ErrorState.BUS_OFF if self._connection is None else ErrorState.ERROR_ACTIVE,
            sent=self.counts["sent"],
            received=self.counts["received"],
            send_refused=self.counts["send_refused"],
        )

    async def wait_lost(self) -> str:
        """As ``OpenBus`` says; without ``give_up_s`` it never returns, for the server always may come back."""
        return await asyncio.shield(self._lost)

    async def close(self) -> None:
        """End the connection and give up coming back."""
        self._closed = True
        if self._returning is not None:
            self._returning.cancel()
        connection, self._connection = self._connection, None
        if connection is not None:
            await connection.close()

    async def _connect(self) -> None:
        def connection() -> _Connection:
            return _Connection(self._channel, self.counts, self._on_frame, self._on_disconnect)

        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            transport, made = await self._loop.create_connection(connection, *self._address)
            try:
                await made.ready
            except BaseException:  # cancelled or not: no socket is left behind
                transport.abort()
                raise
        if self._closed:
            transport.abort()
            return
        self._connection = made

    async def _return(self) -> None:
        """Connect again, until given up; the server's refusals are no different from its absence."""
        pause_s = BACKOFF_S
        lost_at = self._loop.time()
        while True:
            await asyncio.sleep(pause_s)
            if self._give_up_s is not None and self._loop.time() - lost_at >= self._give_up_s:
                self._lost.set_result(f"no server at {self.name} for {self._give_up_s:g} s")
                return
            self.counts["reconnect_attempts"] += 1
            try:
                await self._connect()
            except (OSError, TimeoutError):
                pause_s = min(2 * pause_s, BACKOFF_MAX_S)
            else:
                self.counts["reconnects"] += 1
                return

    def _on_disconnect(self, connection: "_Connection") -> None:
        if connection is self._connection and not self._closed:
            self._connection = None
            self.counts["disconnects"] += 1
            self._returning = self._loop.create_task(self._return())

    def _on_frame(self, frame: Frame) -> None:
        if not self._closed:
            self.counts["received"] += 1
            self._subscribers.received(frame)

    def _sent(self, frame: Frame) -> None:
        self.counts["sent"] += 1
        if not self._closed:
            self._subscribers.sent(frame)


class _Connection(asyncio.Protocol):
    """One TCP connection, from greeting to end. ``ready`` is done once raw mode is on."""

    #: What the server says in order, and our answer to each.
    GREETING: ClassVar = ("hi", "ok", "ok")

    def __init__(self, channel: str, counts: Counter[str], on_frame: "_OnFrame", on_end: "_OnEnd") -> None:
        loop = asyncio.get_running_loop()
        self.ready: asyncio.Future[None] = loop.create_future()
        self._ended: asyncio.Future[None] = loop.create_future()
        self._answers = (f"< open {channel} >", "< rawmode >", "< echo >")
        self._stage = 0
        self._counts = counts
        self._on_frame = on_frame
        self._on_end = on_end
        self._splitter = Splitter()
        self._transport: asyncio.Transport | None = None

    def write(self, message: bytes) -> bool:
        """Queue a message for TCP; False where the server takes too little."""
        if self._transport is None or self._transport.is_closing():
            return False
        if self._transport.get_write_buffer_size() > WRITE_LIMIT:
            return False
        self._transport.write(message)
        return True

    async def close(self) -> None:
        """Send what is queued and end; a server that takes nothing is not waited for."""
        if self._transport is None:
            return
        self._transport.close()
        _, late = await asyncio.wait([self._ended], timeout=1)
        if late:
            self._transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio asks."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def connection_lost(self, exc: Exception | None) -> None:
        """As asyncio asks."""
        self._transport = None
        self._ended.set_result(None)
        if not self.ready.done():
            self.ready.set_exception(exc or ConnectionError("the server has closed the connection"))
        self._on_end(self)

    def data_received(self, data: bytes) -> None:
        """As asyncio asks."""
        garbage = self._splitter.garbage
        for message in self._splitter.feed(data):
            self._on_message(message)
        self._counts["malformed"] += self._splitter.garbage - garbage

    def _on_message(self, message: str) -> None:
        kind, *words = message.split(" ")
        if self._stage < len(self.GREETING):
            self._greet(message)
        elif kind == "frame":
            try:
                self._on_frame(parse_frame(words))
            except ValueError:
                self._counts["malformed"] += 1
        elif kind == "error":
            self._counts["server_errors"] += 1
        elif message != "echo":
            self._counts["malformed"] += 1

    def _greet(self, message: str) -> None:
        assert self._transport is not None
        if message != self.GREETING[self._stage]:
            if not self.ready.done():
                self.ready.set_exception(ConnectionError(f"the server answered <{message[:60]}>"))
            self._transport.abort()
            return
        # The echo after the last answer tells the server at once that this client is ready for frames.
        self._transport.write(self._answers[self._stage].encode())
        self._stage += 1
        if self._stage == len(self.GREETING) and not self.ready.done():
            self.ready.set_result(None)


_OnFrame = Callable[[Frame], None]
_OnEnd = Callable[[_Connection], None]


async def open_socketcand(settings: BusSettings) -> SocketcandBus:
    """Open the channel of ``settings``, with ``host``, ``port``, ``token_file`` and ``give_up_s`` as further arguments.

    Raises ``BusOpenError``.
    """
    extra = dict(settings.extra)
    host, port = extra.pop("host", "127.0.0.1"), extra.pop("port", DEFAULT_PORT)
    give_up_s, token_file = extra.pop("give_up_s", None), extra.pop("token_file", None)
    if extra:
        unknown = ", ".join(sorted(extra))
        raise BusOpenError(
            f"interface {settings.interface}: unknown argument {unknown}; it takes host, port, token_file and give_up_s"
        )
    if isinstance(port, bool) or not isinstance(port, int) or not 0 < port < 1 << 16:
        raise BusOpenError(f"interface {settings.interface}: port = {port}: must be a number from 1 to 65535")
    if give_up_s is not None and (isinstance(give_up_s, bool | str) or not give_up_s > 0):
        raise BusOpenError(f"interface {settings.interface}: give_up_s = {give_up_s}: must be a number above 0")
    if not settings.channel or any(letter in "<> " for letter in settings.channel):
        raise BusOpenError(f'interface {settings.interface}: channel = "{settings.channel}": must be one word')
    channel = settings.channel
    if token_file is not None:
        try:
            channel = f"{channel}:{read_token(Path(str(token_file)))}"
        except OwnedFileError as error:
            raise BusOpenError(f"interface {settings.interface}: token_file = {error}") from error
    bus = SocketcandBus(str(host), port, channel, give_up_s)
    await bus.start()
    return bus

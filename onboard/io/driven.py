"""``ports.Bus`` over a driver: what is counted, confirmed, tried again and given up, whatever moves the frames."""

import asyncio
from collections import Counter
from typing import NamedTuple, Protocol

from onboard.core.frame import Frame
from onboard.io.receive import BusLostError, LoopReader, Reader, ThreadReader
from onboard.io.subscribers import Subscribers
from onboard.io.transmit import DirectTransmitter, Submitted, ThreadTransmitter, Transmitter, is_sendable
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler

#: Read errors in a row, with no frame between them, after which a bus counts as gone. SocketCAN reports "network is
#: down" once and works again as soon as the interface is up.
READ_ERRORS_LIMIT = 3
#: Own frames whose echo is awaited; beyond that the oldest is forgotten (a bus-off interface drops its queue unseen).
ECHO_LIMIT = 2048

# Error classes and bits of linux/can/error.h, as SocketCAN puts them into an error frame's identifier and data.
_ERR_CRTL, _ERR_BUSOFF, _ERR_RESTARTED, _ERR_CNT = 0x004, 0x040, 0x100, 0x200
_CRTL_PASSIVE, _CRTL_ACTIVE = 0x30, 0x40


class Heard(NamedTuple):
    """A frame that a driver has read; ``is_own`` where this node sent it, ``is_fd`` for one of CAN FD."""

    frame: Frame
    is_own: bool
    is_fd: bool = False


class DriverError(Exception):
    """A driver could not read; ``is_permanent`` where trying again cannot help. ``str`` says why, in a line."""

    def __init__(self, text: str, *, is_permanent: bool) -> None:
        super().__init__(text)
        self.is_permanent = is_permanent


class Driver(Protocol):
    """What moves frames between this process and one interface."""

    @property
    def never_blocks(self) -> bool:
        """Whether ``submit`` returns at once, so that the loop may call it; else a thread does."""

    @property
    def echoes(self) -> bool:
        """Whether it hands a node its own frames, marked as such, once they are on the bus."""

    @property
    def descriptor(self) -> int:
        """A file descriptor that can be read when frames are there, -1 where there is none."""

    def submit(self, frame: Frame) -> Submitted:
        """Hand a frame to the interface's queue. Never raises."""

    def take(self, timeout_s: float) -> Heard | None:
        """The next frame, None where none came in time. Raises ``DriverError``."""

    def has_ended(self) -> bool:
        """Whether the connection is over though nothing says so."""

    def shut_down(self) -> None:
        """Give the interface back; may block. Never raises."""


class DrivenBus:
    """One node's connection to a bus through a driver.

    ``on_sent`` is called when the interface hands the frame back from the bus, where it can (SocketCAN, virtual), so
    that some other node has acknowledged it. With other interfaces it is called once the driver has taken the frame,
    which proves nothing about the bus. CAN FD and error frames are counted and not handed on; from SocketCAN's error
    frames ``health`` takes error state and counters.
    """

    def __init__(self, driver: Driver, name: str) -> None:
        """Take over an open driver on the running loop."""
        self.name = name
        self.state = ErrorState.ERROR_ACTIVE
        self.counts: Counter[str] = Counter()
        self._loop = asyncio.get_running_loop()
        self._lost: asyncio.Future[str] = self._loop.create_future()
        self._driver = driver
        self._closed = False
        self._error_counters = (0, 0)
        self._awaited: dict[Frame, int] = {}
        self._awaited_total = 0
        self._read_errors = 0
        self._subscribers = Subscribers(self._loop, self.name)
        self._transmitter = self._start_transmitter()
        self._reader = self._start_reader()

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """As in the port. Frames that came before the first subscriber are counted as received and gone."""
        self._subscribers.add(on_frame, on_sent)

    def send(self, frame: Frame) -> bool:
        """As in the port. An accepted frame that the driver refuses for half a second is given up and counted."""
        if self._closed or self._lost.done() or not is_sendable(frame) or not self._transmitter.send(frame):
            self.counts["send_refused"] += 1
            return False
        return True

    def health(self) -> BusHealth:
        """Error counters as the driver told them last in an error frame, all others as counted here."""
        tec, rec = self._error_counters
        return BusHealth(
            self.state,
            tec,
            rec,
            self.counts["sent"],
            self.counts["received"],
            self.counts["send_refused"],
            self._reader.overflows,
        )

    async def wait_lost(self) -> str:
        """Return, with the reason in words, once the bus is gone: adapter unplugged, server vanished."""
        return await asyncio.shield(self._lost)

    async def close(self) -> None:
        """As in the port. Takes up to a tenth of a second where a thread reads."""
        if self._closed:
            return
        self._closed = True
        self._transmitter.stop()
        await self._reader.stop()
        await self._loop.run_in_executor(None, self._driver.shut_down)

    # --- out ---------------------------------------------------------------------------------------------------

    def _start_transmitter(self) -> Transmitter:
        if self._driver.never_blocks:
            return DirectTransmitter(self._loop, self._driver.submit, self._on_done)
        return ThreadTransmitter(self._loop, self._driver.submit, self._on_done, self.name)

    def _on_done(self, frame: Frame, result: Submitted) -> None:
        if result is Submitted.SENT:
            if self._driver.echoes:
                self._await_echo(frame)
            else:
                self._loop.call_soon(self._sent, frame)
            return
        if result is Submitted.LOST:
            self._on_lost("sending failed: the connection has ended or the adapter is gone")
        self.counts["send_failed"] += 1

    def _sent(self, frame: Frame) -> None:
        self.counts["sent"] += 1
        if not self._closed:
            self._subscribers.sent(frame)

    def _await_echo(self, frame: Frame) -> None:
        if self._awaited_total >= ECHO_LIMIT:
            self.counts["echo_missing"] += 1
            self._forget(next(iter(self._awaited)))
        self._awaited[frame] = self._awaited.get(frame, 0) + 1
        self._awaited_total += 1

    def _forget(self, frame: Frame) -> None:
        count = self._awaited.pop(frame) - 1
        self._awaited_total -= 1
        if count:
            self._awaited[frame] = count

    # --- in ----------------------------------------------------------------------------------------------------

    def _start_reader(self) -> Reader:
        if self._driver.descriptor >= 0:
            return LoopReader(self._loop, self._driver.descriptor, self._take, self._on_heard, self._on_lost)
        return ThreadReader(self._loop, self._take, self._on_heard, self._on_lost, self.name)

    def _take(self, timeout_s: float) -> Heard | None:
        """The next frame; in the loop or in the reader's thread."""
        try:
            heard = self._driver.take(timeout_s)
        except DriverError as error:
            if self._closed:
                return None
            self._read_errors += 1
            if error.is_permanent or self._read_errors >= READ_ERRORS_LIMIT:
                raise BusLostError(f"reading failed: {error}") from error
            self.state = ErrorState.BUS_OFF
            return None
        if heard is not None:
            self._read_errors = 0
        elif self._driver.has_ended():
            raise BusLostError("the server has closed the connection")
        return heard

    def _on_heard(self, heard: Heard) -> None:
        frame = heard.frame
        if self._closed:
            return
        if frame.is_error:
            self._on_error_frame(frame)
            return
        if heard.is_fd:
            self.counts["fd_frames"] += 1
            return
        if self.state is ErrorState.BUS_OFF:
            # Where no "restarted" was heard, a frame tells as much.
            self.state = ErrorState.ERROR_ACTIVE
        if self._driver.echoes and heard.is_own and frame in self._awaited:
            self._forget(frame)
            self._sent(frame)
            return
        self.counts["received"] += 1
        self._subscribers.received(frame)

    def _on_error_frame(self, frame: Frame) -> None:
        self.counts["error_frames"] += 1
        classes, data = frame.arbitration_id, frame.data.ljust(8, b"\0")
        if classes & _ERR_CNT or data[6] or data[7]:
            self._error_counters = (data[6], data[7])
        if classes & _ERR_BUSOFF:
            self.state = ErrorState.BUS_OFF
        elif classes & _ERR_RESTARTED:
            self.state = ErrorState.ERROR_ACTIVE
        elif classes & _ERR_CRTL and data[1] & _CRTL_PASSIVE:
            self.state = ErrorState.ERROR_PASSIVE
        elif classes & _ERR_CRTL and data[1] & _CRTL_ACTIVE:
            self.state = ErrorState.ERROR_ACTIVE

    def _on_lost(self, why: str) -> None:
        if not self._lost.done() and not self._closed:
            self._lost.set_result(f"bus {self.name}: {why}")
            self._transmitter.stop()

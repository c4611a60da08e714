"""``ports.Bus`` over any interface of python-can 4.6: the one file that imports it."""

import asyncio
import errno
import fcntl
import logging
import socket
import struct
from collections import Counter
from difflib import get_close_matches
from typing import Any

import can

from onboard.core.frame import CAN_MAX_DLC, Frame
from onboard.io.receive import BusLostError, LoopReader, Reader, ThreadReader
from onboard.io.settings import BusOpenError, BusSettings
from onboard.io.subscribers import Subscribers
from onboard.io.transmit import DirectTransmitter, Submitted, ThreadTransmitter, Transmitter, is_sendable
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler

#: Interfaces whose ``send`` never blocks; every other one gets a thread to send from.
NEVER_BLOCKING = frozenset({"socketcan", "virtual", "udp_multicast"})
#: Interfaces that hand a node its own frames, marked as such, once they are on the bus.
ECHOING = frozenset({"socketcan", "virtual"})
#: Read errors in a row, with no frame between them, after which a bus counts as gone. SocketCAN reports "network is
#: down" once and works again as soon as the interface is up.
READ_ERRORS_LIMIT = 3
#: Own frames whose echo is awaited; beyond that the oldest is forgotten (a bus-off interface drops its queue unseen).
ECHO_LIMIT = 2048
CONNECT_TIMEOUT_S = 3.0

# Error classes and bits of linux/can/error.h, as SocketCAN puts them into an error frame's identifier and data.
_ERR_CRTL, _ERR_BUSOFF, _ERR_RESTARTED, _ERR_CNT = 0x004, 0x040, 0x100, 0x200
_CRTL_PASSIVE, _CRTL_ACTIVE = 0x30, 0x40

# Linux netdevice(7).
_SIOCGIFFLAGS, _IFF_UP = 0x8913, 0x1

_log = logging.getLogger("onboard.io.pycan")


class PythonCanBus:
    """One node's connection to a bus through python-can.

    ``on_sent`` is called when the interface hands the frame back from the bus, where it can (SocketCAN, virtual), so
    that some other node has acknowledged it. With other interfaces it is called once python-can's ``send`` has
    returned, which proves nothing about the bus. CAN FD and error frames are counted and not handed on; from
    SocketCAN's error frames ``health`` takes error state and counters.
    """

    def __init__(self, bus: can.BusABC, settings: BusSettings, *, echoing: bool | None = None) -> None:
        """Take over an opened bus on the running loop. ``echoing`` None: as the interface is known to be."""
        self.name = str(settings)
        self.state = ErrorState.ERROR_ACTIVE
        self.counts: Counter[str] = Counter()
        self._loop = asyncio.get_running_loop()
        self._lost: asyncio.Future[str] = self._loop.create_future()
        self._bus = bus
        self._closed = False
        self._error_counters = (0, 0)
        self._echoing = settings.interface in ECHOING if echoing is None else echoing
        self._awaited: dict[Frame, int] = {}
        self._awaited_total = 0
        self._read_errors = 0
        # Only a TCP connection can end without the driver telling; SocketCAN's socket is not of this kind.
        self._streams = [one for one in vars(bus).values() if isinstance(one, socket.socket) and _is_stream(one)]
        self._subscribers = Subscribers(self._loop, self.name)
        self._transmitter = self._start_transmitter(settings)
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
        await self._loop.run_in_executor(None, _shut_down, self._bus)

    # --- out ---------------------------------------------------------------------------------------------------

    def _start_transmitter(self, settings: BusSettings) -> Transmitter:
        if settings.interface in NEVER_BLOCKING:
            return DirectTransmitter(self._loop, self._submit, self._on_done)
        return ThreadTransmitter(self._loop, self._submit, self._on_done, self.name)

    def _submit(self, frame: Frame) -> Submitted:
        """Hand one frame to the driver; in the loop or in the sender's thread."""
        try:
            self._bus.send(_to_message(frame), timeout=0)
        except can.CanError as error:
            if error.error_code in (errno.ENOBUFS, errno.EAGAIN) or "buffer full" in str(error).lower():
                return Submitted.FULL
            if error.error_code in (errno.ENODEV, errno.ENXIO):
                return Submitted.LOST
            return Submitted.FAILED
        except OSError:
            # python-can's socketcand lets the socket's errors through: the connection has ended.
            return Submitted.LOST
        except Exception as error:  # noqa: BLE001 - a driver may raise anything; the port must not
            _log.debug("bus %s: send: %r", self.name, error)
            return Submitted.FAILED
        return Submitted.SENT

    def _on_done(self, frame: Frame, result: Submitted) -> None:
        if result is Submitted.SENT:
            if self._echoing:
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
        try:
            descriptor = self._bus.fileno()
        except NotImplementedError:
            descriptor = -1
        if descriptor >= 0:
            return LoopReader(self._loop, descriptor, self._take, self._on_message, self._on_lost)
        return ThreadReader(self._loop, self._take, self._on_message, self._on_lost, self.name)

    def _take(self, timeout: float) -> can.Message | None:
        """The next message; in the loop or in the reader's thread."""
        try:
            message = self._bus.recv(timeout)
        except Exception as error:  # a driver may raise anything, and must not end the thread in silence
            if self._closed:
                return None
            self._read_errors += 1
            permanent = not isinstance(error, can.CanError) or error.error_code in (None, errno.ENODEV, errno.ENXIO)
            if permanent or self._read_errors >= READ_ERRORS_LIMIT:
                raise BusLostError(f"reading failed: {_first_line(error)}") from error
            self.state = ErrorState.BUS_OFF
            return None
        if message is not None:
            self._read_errors = 0
        elif any(_has_ended(stream) for stream in self._streams):
            raise BusLostError("the server has closed the connection")
        return message

    def _on_message(self, message: can.Message) -> None:
        if self._closed:
            return
        if message.is_error_frame:
            self._on_error_frame(message)
            return
        if message.is_fd or message.dlc > CAN_MAX_DLC:
            self.counts["fd_frames"] += 1
            return
        if self.state is ErrorState.BUS_OFF:
            # Where no "restarted" was heard, a frame tells as much.
            self.state = ErrorState.ERROR_ACTIVE
        frame = _to_frame(message)
        if self._echoing and not message.is_rx and frame in self._awaited:
            self._forget(frame)
            self._sent(frame)
            return
        self.counts["received"] += 1
        self._subscribers.received(frame)

    def _on_error_frame(self, message: can.Message) -> None:
        self.counts["error_frames"] += 1
        classes, data = message.arbitration_id, bytes(message.data).ljust(8, b"\0")
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


async def open_python_can(settings: BusSettings) -> PythonCanBus:
    """Open an interface of python-can, without the configuration files of python-can's own tools.

    Raises ``BusOpenError``. Runs in a thread, for some drivers take seconds.
    """
    if settings.interface not in can.VALID_INTERFACES:
        near = get_close_matches(settings.interface, sorted(can.VALID_INTERFACES), n=1)
        remedy = f'did you mean "{near[0]}"?' if near else "known: " + ", ".join(sorted(can.VALID_INTERFACES))
        raise BusOpenError(f'interface "{settings.interface}": python-can does not know it; {remedy}')
    loop = asyncio.get_running_loop()
    bus = await loop.run_in_executor(None, _open, settings)
    return PythonCanBus(bus, settings, echoing=dict(settings.extra).get("receive_own_messages"))


def _open(settings: BusSettings) -> can.BusABC:
    keywords: dict[str, Any] = {"bitrate": settings.bitrate}
    if settings.interface in ECHOING:
        keywords["receive_own_messages"] = True
    keywords.update(settings.extra)
    try:
        if settings.interface == "socketcand" and {"host", "port"} <= keywords.keys():
            # python-can would try again in a busy loop for ten seconds, with a warning each time.
            socket.create_connection((str(keywords["host"]), int(keywords["port"])), CONNECT_TIMEOUT_S).close()
        bus = can.Bus(interface=settings.interface, channel=settings.channel, ignore_config=True, **keywords)
    except Exception as error:  # a driver may raise anything; it becomes one line for a person
        where = f'interface "{settings.interface}", channel "{settings.channel}"'
        text = f"{where}: {_first_line(error)}; {_remedy(settings, error)}"
        raise BusOpenError(text, may_come=_may_come(error)) from error
    if settings.interface == "socketcan" and not _is_up(settings.channel):
        bus.shutdown()
        text = f'interface "socketcan", channel "{settings.channel}": it is down; `ip link set {settings.channel} up`'
        raise BusOpenError(text, may_come=True)
    return bus


def _is_up(channel: str) -> bool:
    """Whether an interface of this network namespace is switched on (netdevice(7), SIOCGIFFLAGS).

    A controller on one that is down would take the silence for an empty site. ``can.Bus`` has opened it, so it was
    there; what cannot be asked is not in the way.
    """
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as asking:
        try:
            answer = fcntl.ioctl(asking, _SIOCGIFFLAGS, struct.pack("16sH14x", channel.encode(), 0))
        except OSError:
            return True
    return bool(struct.unpack("16sH14x", answer)[1] & _IFF_UP)


def _errno_of(error: Exception) -> int | None:
    return getattr(error, "errno", None) or getattr(error, "error_code", None)


def _may_come(error: Exception) -> bool:
    """Whether time alone may heal it: no adapter yet, no server yet. A missing driver and a wrong word it does not."""
    if isinstance(error, ImportError | TypeError | ValueError) or "import" in str(error):
        return False
    return _errno_of(error) not in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT, errno.EACCES, errno.EPERM)


def _remedy(settings: BusSettings, error: Exception) -> str:
    number = _errno_of(error)
    if isinstance(error, ImportError) or "import" in str(error):
        return "install the driver's Python package"
    if isinstance(error, TypeError):
        return "give what the interface needs with --bus-kwargs NAME=VALUE ..., or in the machine file"
    if settings.interface == "socketcan" and number == errno.ENODEV:
        return "`ip link` lists the interfaces of this computer"
    if settings.interface == "socketcan" and number in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT):
        return "this kernel has no SocketCAN; load the module can_raw, or join over socketcand"
    if settings.interface == "socketcand":
        return "is the server running, on this host and port, and does it have this channel?"
    return "check channel and --bus-kwargs"


def _first_line(error: BaseException) -> str:
    text = (str(error) or type(error).__name__).strip()
    return text.splitlines()[0][:200].rstrip(".")


def _shut_down(bus: can.BusABC) -> None:
    """A driver may fail on its way out, as when its adapter is gone; nothing is left to save then."""
    try:
        bus.shutdown()
    except Exception as error:  # noqa: BLE001 - see above
        _log.debug("shutdown: %r", error)


def _is_stream(one: socket.socket) -> bool:
    return one.type == socket.SOCK_STREAM


def _has_ended(stream: socket.socket) -> bool:
    """Whether the peer has closed. python-can's socketcand reads nothing for ever then, at full speed."""
    try:
        return stream.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def _to_message(frame: Frame) -> can.Message:
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended,
        is_remote_frame=frame.is_remote,
        data=None if frame.is_remote else frame.data,
        dlc=frame.dlc,
    )


def _to_frame(message: can.Message) -> Frame:
    identifier, extended = message.arbitration_id, message.is_extended_id
    if message.is_remote_frame:
        return Frame(identifier, b"", extended, is_remote=True, remote_dlc=message.dlc)
    return Frame(identifier, bytes(message.data), extended)

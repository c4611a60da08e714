"""``ports.Bus`` over any interface of python-can 4.6: the one file that imports it."""

import asyncio
import errno
import logging
import socket
from difflib import get_close_matches
from typing import Any

import can

from onboard.core.frame import CAN_MAX_DLC, Frame
from onboard.io.driven import DrivenBus, DriverError, Heard
from onboard.io.settings import BusOpenError, BusSettings
from onboard.io.socketcan import is_up, remedy
from onboard.io.transmit import Submitted

#: Interfaces whose ``send`` never blocks; every other one gets a thread to send from.
NEVER_BLOCKING = frozenset({"socketcan", "virtual", "udp_multicast"})
#: Interfaces that hand a node its own frames, marked as such, once they are on the bus.
ECHOING = frozenset({"socketcan", "virtual"})
CONNECT_TIMEOUT_S = 3.0

_log = logging.getLogger("onboard.io.pycan")


class PythonCanDriver:
    """An opened bus of python-can as a driver."""

    def __init__(self, bus: can.BusABC, settings: BusSettings, *, echoing: bool | None = None) -> None:
        """``echoing`` None: as the interface is known to be."""
        self.never_blocks = settings.interface in NEVER_BLOCKING
        self.echoes = settings.interface in ECHOING if echoing is None else echoing
        self._bus = bus
        self._name = str(settings)
        # Only a TCP connection can end without the driver telling; SocketCAN's socket is not of this kind.
        self._streams = [one for one in vars(bus).values() if isinstance(one, socket.socket) and _is_stream(one)]

    @property
    def descriptor(self) -> int:
        """That of the interface; -1 for most."""
        try:
            return self._bus.fileno()
        except NotImplementedError:
            return -1

    def submit(self, frame: Frame) -> Submitted:
        """Hand one frame to python-can; in the loop or in the sender's thread."""
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
            _log.debug("bus %s: send: %r", self._name, error)
            return Submitted.FAILED
        return Submitted.SENT

    def take(self, timeout_s: float) -> Heard | None:
        """The next message; in the loop or in the reader's thread. Raises ``DriverError``."""
        try:
            message = self._bus.recv(timeout_s)
        except Exception as error:  # a driver may raise anything, and must not end the thread in silence
            is_permanent = not isinstance(error, can.CanError) or error.error_code in (None, errno.ENODEV, errno.ENXIO)
            raise DriverError(_first_line(error), is_permanent=is_permanent) from error
        return None if message is None else _heard(message)

    def has_ended(self) -> bool:
        """Whether a server has closed its connection."""
        return any(_has_ended(stream) for stream in self._streams)

    def shut_down(self) -> None:
        """A driver may fail on its way out, as when its adapter is gone; nothing is left to save then."""
        try:
            self._bus.shutdown()
        except Exception as error:  # noqa: BLE001 - see above
            _log.debug("shutdown: %r", error)


class PythonCanBus(DrivenBus):
    """One node's connection to a bus through python-can."""

    def __init__(self, bus: can.BusABC, settings: BusSettings, *, echoing: bool | None = None) -> None:
        """Take over an opened bus on the running loop. ``echoing`` None: as the interface is known to be."""
        super().__init__(PythonCanDriver(bus, settings, echoing=echoing), str(settings))


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
    if settings.interface == "socketcan" and not is_up(settings.channel):
        bus.shutdown()
        text = f'interface "socketcan", channel "{settings.channel}": it is down; `ip link set {settings.channel} up`'
        raise BusOpenError(text, may_come=True)
    return bus


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
    if settings.interface == "socketcan" and number in (errno.ENODEV, errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT):
        return remedy(OSError(number, ""))
    if settings.interface == "socketcand":
        return "is the server running, on this host and port, and does it have this channel?"
    return "check channel and --bus-kwargs"


def _first_line(error: BaseException) -> str:
    text = (str(error) or type(error).__name__).strip()
    return text.splitlines()[0][:200].rstrip(".")


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


def _heard(message: can.Message) -> Heard:
    identifier, is_extended, data = message.arbitration_id, message.is_extended_id, bytes(message.data)
    is_fd = message.is_fd or message.dlc > CAN_MAX_DLC
    if message.is_error_frame:
        return Heard(Frame(identifier, data, is_error=True), is_own=False)
    if message.is_remote_frame:
        frame = Frame(identifier, b"", is_extended, is_remote=True, remote_dlc=message.dlc)
    else:
        frame = Frame(identifier, data, is_extended)
    return Heard(frame, not message.is_rx, is_fd)

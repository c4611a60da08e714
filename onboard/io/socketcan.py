"""SocketCAN through the standard library: what a board's own bus needs, without the 5 MB and 0.1 s of python-can.

Layouts and flags are those of the kernel (Documentation/networking/can.rst, linux/can.h, linux/can/raw.h).
"""

import errno
import fcntl
import socket
import struct
import sys

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK, Frame
from onboard.io.driven import DrivenBus, DriverError, Heard
from onboard.io.settings import BusOpenError, BusSettings
from onboard.io.transmit import Submitted

#: ``struct can_frame``: identifier with flags, length, three bytes of padding, data.
_FRAME = struct.Struct("=IB3x8s")
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
#: Linux netdevice(7).
_SIOCGIFFLAGS, _IFF_UP = 0x8913, 0x1
#: Of ``recvmsg``: this socket itself sent the frame.
_MSG_CONFIRM = 0x800
#: ``CAN_RAW_ERR_FILTER`` of linux/can/raw.h, which the standard library does not name everywhere.
_ERR_FILTER = 2
_GONE = frozenset({errno.ENODEV, errno.ENXIO})
_NO_SOCKETCAN = frozenset({errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT})


class SocketCanDriver:
    """A raw socket of one interface. Everything is as the kernel queues it: it never blocks."""

    never_blocks = True

    def __init__(self, raw: socket.socket, *, echoes: bool) -> None:
        """Take over a bound socket that does not block; ``echoes`` as it is set to hand back its own frames."""
        self.echoes = echoes
        self._raw = raw

    @property
    def descriptor(self) -> int:
        """The socket's own; readable while frames wait in its queue."""
        return self._raw.fileno()

    def submit(self, frame: Frame) -> Submitted:
        """A full queue of the interface (``txqueuelen``) is told at once (ENOBUFS)."""
        try:
            self._raw.send(to_bytes(frame))
        except OSError as error:
            if error.errno in (errno.ENOBUFS, errno.EAGAIN):
                return Submitted.FULL
            return Submitted.LOST if error.errno in _GONE else Submitted.FAILED
        return Submitted.SENT

    def take(self, timeout_s: float) -> Heard | None:
        """The next frame of the socket's queue; it never waits. Raises ``DriverError``."""
        try:
            content, _, flags, _ = self._raw.recvmsg(_FRAME.size)
        except BlockingIOError:
            return None
        except OSError as error:
            raise DriverError(error.strerror or str(error), is_permanent=error.errno in _GONE) from error
        return Heard(to_frame(content), bool(flags & _MSG_CONFIRM))

    def has_ended(self) -> bool:
        """Never: an interface that goes is told of (ENODEV)."""
        return False

    def shut_down(self) -> None:
        """Close the socket; frames that the interface still holds go out."""
        self._raw.close()


def to_bytes(frame: Frame) -> bytes:
    """``struct can_frame`` of a data or remote frame."""
    flags = (_EXTENDED if frame.is_extended else 0) | (_REMOTE if frame.is_remote else 0)
    return _FRAME.pack(frame.arbitration_id | flags, frame.dlc, frame.data)


def to_frame(content: bytes) -> Frame:
    """The frame in a ``struct can_frame``."""
    word, length, data = _FRAME.unpack(content)
    length = min(length, CAN_MAX_DLC)
    if word & _ERROR:
        return Frame(word & CAN_EFF_MASK, data[:length], is_error=True)
    is_extended = bool(word & _EXTENDED)
    identifier = word & (CAN_EFF_MASK if is_extended else CAN_SFF_MASK)
    if word & _REMOTE:
        return Frame(identifier, b"", is_extended, is_remote=True, remote_dlc=length)
    return Frame(identifier, data[:length], is_extended)


async def open_socketcan(settings: BusSettings) -> DrivenBus:
    """Open an interface on the running loop. Raises ``BusOpenError``."""
    echoes = bool(dict(settings.extra).get("receive_own_messages", True))
    return DrivenBus(SocketCanDriver(_opened(settings.channel, echoes=echoes), echoes=echoes), str(settings))


def _opened(channel: str, *, echoes: bool) -> socket.socket:
    where = f'interface "socketcan", channel "{channel}"'
    if sys.platform != "linux":
        raise BusOpenError(f"{where}: only Linux has SocketCAN; join over socketcand, or name another interface")
    try:
        raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise BusOpenError(f"{where}: {error.strerror}; {remedy(error)}") from error
    try:
        raw.setblocking(False)
        raw.setsockopt(socket.SOL_CAN_RAW, _ERR_FILTER, CAN_EFF_MASK)
        raw.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, int(echoes))
        raw.bind((channel,))
    except OSError as error:
        raw.close()
        may_come = error.errno not in (errno.EACCES, errno.EPERM, errno.EINVAL)
        raise BusOpenError(f"{where}: {error.strerror or error}; {remedy(error)}", may_come=may_come) from error
    if not is_up(channel):
        raw.close()
        raise BusOpenError(f"{where}: it is down; `ip link set {channel} up`", may_come=True)
    return raw


def remedy(error: OSError) -> str:
    """What a person does about an interface that could not be opened."""
    if error.errno in _NO_SOCKETCAN:
        return "this kernel has no SocketCAN; load the module can_raw, or join over socketcand"
    return "`ip link` lists the interfaces of this computer"


def is_up(channel: str) -> bool:
    """Whether an interface of this network namespace is switched on (netdevice(7), SIOCGIFFLAGS).

    A controller on one that is down would take the silence for an empty site. The caller has opened it, so it was
    there; what cannot be asked is not in the way.
    """
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as asking:
        try:
            answer = fcntl.ioctl(asking, _SIOCGIFFLAGS, struct.pack("16sH14x", channel.encode(), 0))
        except OSError:
            return True
    return bool(struct.unpack("16sH14x", answer)[1] & _IFF_UP)

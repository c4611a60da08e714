"""One frame of any CAN log, of whatever bus: classic or FD, with its mark of direction. Nothing in it is judged."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, Frame

#: Bits of the flags nibble of a CAN FD frame in a candump log (``struct canfd_frame``, linux/can.h).
CANFD_BRS, CANFD_ESI, CANFD_FDF = 0x1, 0x2, 0x4
#: Flag bits above the identifier in a ``can_id`` of SocketCAN (linux/can.h).
EFF_FLAG, RTR_FLAG, ERR_FLAG = 0x8000_0000, 0x4000_0000, 0x2000_0000
#: Most data bytes of a CAN FD frame (ISO 11898-1).
CANFD_MAX_LEN = 64
#: Keys of data frames: data, identifier, and the length, marked as a key and as a long identifier's.
KEY_BYTES, KEY_IS_LONG, KEY_MARK = CAN_MAX_DLC + 5, 0x40, 0x80
_KEY_LENGTH = 0x0F
#: ``Frame`` from a tuple of all its fields: half the time of calling the class.
_frame_of: Callable[[Any], Frame] = partial(tuple.__new__, Frame)


class RawFrame(NamedTuple):
    """A frame as a log holds it; ``time_us`` since the epoch, or since the log's start where it tells no date.

    ``can_id`` has no flag bits. ``fd_flags`` is None for a classic frame, else its flags nibble. ``sent`` tells whether
    the recording host itself sent the frame, None where the log does not say. An error frame carries the class bits of
    linux/can/error.h in ``can_id``.
    """

    time_us: int
    channel: str
    can_id: int
    data: bytes = b""
    is_extended: bool = False
    is_remote: bool = False
    is_error: bool = False
    remote_dlc: int = 0
    fd_flags: int | None = None
    sent: bool | None = None

    @property
    def length(self) -> int:
        """Data bytes; of a remote frame those asked for."""
        return self.remote_dlc if self.is_remote else len(self.data)

    @property
    def is_data(self) -> bool:
        """Whether it is a classic data frame."""
        return not (self.is_error or self.is_remote) and self.fd_flags is None

    @property
    def socketcan_id(self) -> int:
        """``can_id`` with SocketCAN's flag bits, as its filters see it."""
        flags = EFF_FLAG * self.is_extended | RTR_FLAG * self.is_remote | ERR_FLAG * self.is_error
        return self.can_id & CAN_EFF_MASK | flags

    def classic(self) -> Frame | None:
        """The frame as controllers know frames; None for CAN FD, which none of them speaks."""
        if self.fd_flags is not None:
            return None
        return _frame_of(self[2:8])


def data_frame(key: bytes) -> tuple[int, bytes, bool]:
    """Identifier, data, and whether the identifier is a long one, of the frame with this key (``FrameBlock.keys``)."""
    last = key[-1]
    return int.from_bytes(key[CAN_MAX_DLC:-1], "little"), key[: last & _KEY_LENGTH], last & KEY_IS_LONG != 0

"""One CAN frame as every layer sees it."""

from typing import NamedTuple

CAN_EFF_MASK = 0x1FFFFFFF
CAN_SFF_MASK = 0x7FF
CAN_MAX_DLC = 8


class Frame(NamedTuple):
    """A classic CAN 2.0 frame (ISO 11898-1): what is on the wire, without time or direction.

    ``arbitration_id`` is 11 bits, or 29 bits where ``is_extended``. ``dlc`` of a remote frame is the length asked
    for, 0 to 8, and its ``data`` is empty; of a data frame it is ``len(data)``. An error frame carries the eight
    data bytes and the class bits of Linux ``linux/can/error.h`` in its identifier.
    """

    arbitration_id: int
    data: bytes = b""
    is_extended: bool = True
    is_remote: bool = False
    is_error: bool = False
    remote_dlc: int = 0

    @property
    def dlc(self) -> int:
        """Data length code, 0 to 8."""
        return self.remote_dlc if self.is_remote else len(self.data)

"""Logs that python-can reads: Vector BLF, and PEAK TRC from version 1.0 to 2.1.

Bus n of the file is the channel ``canN``, as in an ASC log; python-can counts those of a BLF from 0. Dates are taken
for UTC. Damage ends the reading, counted as CUT: nothing says where to go on.
"""

import io
import struct
import zlib
from collections.abc import Callable, Iterator

import can
from can.io.blf import BLFParseError

from onboard.core.frame import CAN_EFF_MASK
from onboard.trace.raw import CANFD_BRS, CANFD_ESI, CANFD_FDF, RawFrame
from onboard.trace.readers.faults import LogFault, LogFaults

#: What a file begins with.
BLF_MAGIC, TRC_MAGIC = b"LOGG", b";$FILEVERSION"
#: What python-can's readers raise for a damaged file.
_DAMAGE = (
    *(can.CanError, BLFParseError, struct.error, zlib.error),
    *(ArithmeticError, EOFError, LookupError, TypeError, ValueError),
)
_ERROR_CLASS_BUS = 0x80
_MILLION = 1_000_000


class _Stream(io.RawIOBase):
    """What is read by one function, as the file that python-can asks for."""

    def __init__(self, read: Callable[[int], bytes]) -> None:
        super().__init__()
        self._read = read
        self.size = 0

    def readable(self) -> bool:
        return True

    def readinto(self, into: memoryview) -> int:  # type: ignore[override]  # any buffer to typeshed, a view to Python
        data = self._read(len(into))
        into[: len(data)] = data
        self.size += len(data)
        return len(data)


def read_blf(read: Callable[[int], bytes], faults: LogFaults) -> Iterator[tuple[int, RawFrame]]:
    """Frames of a BLF with their numbers; what else it holds python-can passes over. Its header tells its length."""
    stream, number = _Stream(read), 0
    try:
        reader = can.BLFReader(io.BufferedReader(stream))
        for number, message in enumerate(reader, 1):
            yield number, _frame(message, first_bus=1)
        is_cut = stream.size < reader.file_size
    except _DAMAGE:
        is_cut = True
    if is_cut:
        faults.add(LogFault.CUT, number + 1)


def read_trc(read: Callable[[int], bytes], faults: LogFaults) -> Iterator[tuple[int, RawFrame]]:
    """Frames of a TRC with their numbers."""
    text, number = io.TextIOWrapper(io.BufferedReader(_Stream(read)), encoding="utf-8", errors="replace"), 0
    try:
        for number, message in enumerate(can.TRCReader(text), 1):
            yield number, _frame(message, first_bus=0)
    except _DAMAGE:
        faults.add(LogFault.CUT, number + 1)


def _frame(message: can.Message, first_bus: int) -> RawFrame:
    bus = message.channel
    channel = f"can{bus + first_bus}" if isinstance(bus, int) else str(bus or "can1")
    time_us, sent = round(message.timestamp * _MILLION), not message.is_rx
    if message.is_error_frame:
        return RawFrame(time_us, channel, _ERROR_CLASS_BUS, bytes(8), is_error=True, sent=sent)
    can_id, is_extended = message.arbitration_id & CAN_EFF_MASK, message.is_extended_id
    if message.is_remote_frame:
        return RawFrame(time_us, channel, can_id, b"", is_extended, True, False, message.dlc, None, sent)
    flags = None
    if message.is_fd:
        flags = CANFD_FDF | CANFD_BRS * message.bitrate_switch | CANFD_ESI * message.error_state_indicator
    return RawFrame(time_us, channel, can_id, bytes(message.data), is_extended, fd_flags=flags, sent=sent)

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
#: Longest object of a BLF, and most that a container may unpack to, bytes: CANalyzer packs 128 kB each.
_MOST_OBJECT, _MOST_UNPACKED = 1 << 24, 1 << 24
#: What deflate can make of a byte at most (RFC 1951), and how much is unpacked at once.
_MOST_RATIO, _PIECE = 1_032, 1 << 20
#: A packed container begins so; its data come after so many bytes.
_PACKED, _CONTAINER_HEAD = b"\x02\x00", 16
#: A line of a TRC has some three hundred bytes.
_LONGEST_LINE = 1 << 16
_ERROR_CLASS_BUS = 0x80
_MILLION = 1_000_000


class _Stream(io.RawIOBase):
    """What is read by one function, as the file that python-can asks for.

    With ``longest_line`` a line of more bytes is damage: ``ValueError``.
    """

    def __init__(self, read: Callable[[int], bytes], longest_line: int | None = None) -> None:
        super().__init__()
        self._read = read
        self._longest_line, self._line = longest_line, 0
        self.size = 0

    def readable(self) -> bool:
        return True

    def readinto(self, into: memoryview) -> int:  # type: ignore[override]  # any buffer to typeshed, a view to Python
        data = self._read(len(into))
        into[: len(data)] = data
        self.size += len(data)
        self._line = len(data) - data.rfind(b"\n") - 1 + (0 if b"\n" in data else self._line)
        if self._longest_line is not None and self._line > self._longest_line:
            raise ValueError("no line is so long")
        return len(data)


class _Objects(io.BufferedReader):
    """A BLF's bytes: what is longer than any object, or unpacks to more than any container, is ``BLFParseError``.

    python-can takes the lengths in the file for true, and unpacks a container whole.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= _MOST_OBJECT:
            raise BLFParseError("an object of no possible length")
        data = super().read(size)
        if len(data) * _MOST_RATIO > _MOST_UNPACKED and data.startswith(_PACKED):
            _check_unpacked(data[_CONTAINER_HEAD:])
        return data


def _check_unpacked(packed: bytes) -> None:
    """Unpack piece by piece, and keep nothing. Raises ``BLFParseError`` where it is too much, ``zlib.error``."""
    unpacker, length = zlib.decompressobj(), 0
    while packed:
        length += len(unpacker.decompress(packed, _PIECE))
        packed = unpacker.unconsumed_tail
        if length > _MOST_UNPACKED:
            raise BLFParseError("a container that unpacks to more than any")


def read_blf(read: Callable[[int], bytes], faults: LogFaults) -> Iterator[tuple[int, RawFrame]]:
    """Frames of a BLF with their numbers; what else it holds python-can passes over. Its header tells its length."""
    stream, number = _Stream(read), 0
    try:
        reader = can.BLFReader(_Objects(stream))
        for number, message in enumerate(reader, 1):
            yield number, _frame(message, first_bus=1)
        is_cut = stream.size < reader.file_size
    except _DAMAGE:
        is_cut = True
    if is_cut:
        faults.add(LogFault.CUT, number + 1)


def read_trc(read: Callable[[int], bytes], faults: LogFaults) -> Iterator[tuple[int, RawFrame]]:
    """Frames of a TRC with their numbers."""
    text, number = (
        io.TextIOWrapper(io.BufferedReader(_Stream(read, _LONGEST_LINE)), encoding="utf-8", errors="replace"),
        0,
    )
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

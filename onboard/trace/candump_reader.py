"""Reading logs in the format of ``candump -L``, from can-utils, from python-can and from our own writer."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import NamedTuple

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK, Frame
from onboard.trace.candump import ERROR_FLAG

_LINE = re.compile(
    rb"\((\d{1,12})\.(\d{6}(?:\d{3})?)\)\s+(\S{1,64})\s+([0-9A-Fa-f]+)#(#?)([0-9A-Za-z]*)(?:\s+[RT])?\s*"
)
_SHORT, _LONG = 3, 8
_MILLION = 1_000_000


class LineFault(StrEnum):
    """Why a line gave no frame."""

    NOT_A_LINE = "not a line of candump -L"
    IDENTIFIER = "identifier out of range"
    DATA = "data not whole bytes, or more than 8"
    FD = "CAN FD frame"
    CUT = "last line cut off"


class LogRecord(NamedTuple):
    """One frame of a log; ``time_us`` since the epoch. A nanosecond log is cut to microseconds."""

    time_us: int
    channel: str
    frame: Frame


class CandumpReader:
    """Gives the frames of a log, line by line. Never raises for what a line holds.

    A line that gives no frame is counted in ``faults``, and the first of each fault is kept with its number in
    ``first``. Empty lines are passed over. A last line without its end is not believed, whole as it may look: half of
    its data may be missing.
    """

    def __init__(self, lines: Iterable[bytes]) -> None:
        """``lines`` with their ends, as a binary file gives them; a pipe is read as it comes."""
        self.faults: Counter[LineFault] = Counter()
        self.first: dict[LineFault, int] = {}
        self._lines = lines

    def __iter__(self) -> Iterator[LogRecord]:
        for number, line in enumerate(self._lines, 1):
            if not line.strip():
                continue
            found = parse_line(line) if line.endswith(b"\n") else LineFault.CUT
            if isinstance(found, LogRecord):
                yield found
            else:
                self.faults[found] += 1
                self.first.setdefault(found, number)


def parse_line(line: bytes) -> LogRecord | LineFault:
    """The frame of one line, its end included or not."""
    match = _LINE.fullmatch(line)
    if match is None:
        return LineFault.NOT_A_LINE
    seconds, fraction, channel, digits, flexible, body = match.groups()
    if flexible:
        return LineFault.FD
    frame = _parse_frame(digits.decode(), body.decode())
    if isinstance(frame, LineFault):
        return frame
    return LogRecord(int(seconds) * _MILLION + int(fraction[:6]), channel.decode("utf-8", "replace"), frame)


def _parse_frame(digits: str, body: str) -> Frame | LineFault:
    identifier, extended = int(digits, 16), len(digits) == _LONG
    if len(digits) not in (_SHORT, _LONG) or identifier > (CAN_EFF_MASK | ERROR_FLAG if extended else CAN_SFF_MASK):
        return LineFault.IDENTIFIER
    if body[:1] == "R":
        if not re.fullmatch(r"R[0-8]?", body):
            return LineFault.DATA
        return Frame(identifier, b"", extended, is_remote=True, remote_dlc=int(body[1:] or 0))
    try:
        data = bytes.fromhex(body)
    except ValueError:
        return LineFault.DATA
    if len(data) > CAN_MAX_DLC:
        return LineFault.DATA
    if identifier & ERROR_FLAG:
        return Frame(identifier & CAN_EFF_MASK, data, extended, is_error=True)
    return Frame(identifier, data, extended)

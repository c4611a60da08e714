"""Vector ASC logs: classic, CAN FD, remote and error frames; header as CANalyzer, log2asc and python-can write it.

The date of the header is taken for UTC, as the format names no zone; without one, times begin at 0. Bus n is the
channel ``canN``, as asc2log names it from 1 on: ASC counts from 1, and a few tools from 0. Where a comment of our own
writer names a bus, that is its channel.
"""

import calendar
import re
import time
from collections.abc import Iterable, Iterator

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK
from onboard.trace.raw import CANFD_BRS, CANFD_ESI, CANFD_FDF, CANFD_MAX_LEN, RawFrame
from onboard.trace.readers.faults import LogFault, LogFaults

_TIMED = re.compile(r"\s*(\d+)\.(\d{1,9})\s+(.*)")
_CLASSIC = re.compile(r"(\d+)\s+([0-9A-Fa-f]+)(x?)\s+(Rx|Tx|TxRq)\s+([dr])(?:\s+([0-9A-Fa-f]))?\s*(.*)", re.IGNORECASE)
_FLEXIBLE = re.compile(
    r"CANFD\s+(\d+)\s+(Rx|Tx|TxRq)\s+([0-9A-Fa-f]+)(x?)\s+(?:[^\s01]\S*\s+)?([01])\s+([01])\s+"
    r"([0-9A-Fa-f])\s+(\d+)\s*(.*)",
    re.IGNORECASE,
)
_ERROR = re.compile(r"(?:CANFD\s+)?(\d+)\s+(?:Rx\s+|Tx\s+)?ErrorFrame\b", re.IGNORECASE)
#: What the format says beside frames: headers, statistics, events.
_NO_FRAME = re.compile(
    r"\s*(date\s|base\s|(no\s+)?internal\s+events|begin\s+trigger|end\s+trigger|//|previous\s+log|"
    r"(\d+\.\d+\s+)?(start\s+of\s+measurement|\d+\s+statistic|can\s+\d+\s+status|log\s+trigger|\S+\s+trigger))",
    re.IGNORECASE,
)
#: What ``AscWriter`` says of a bus before its first frame.
_NAMED = re.compile(r"// bus (\d+) is (\S{1,64})")
_ERROR_CLASS_BUS = 0x80
#: Bits of the flags behind the data of a CANFD line, after duration and length in bits.
_REMOTE_MARK, _FLEXIBLE_MARK = 0x10, 0x1000
_ZONES = re.compile(r"\b(GMT|UTC)\b|,")
_DATES = (
    *("%a %b %d %H:%M:%S %Y", "%a %b %d %I:%M:%S %p %Y", "%a %d %b %Y %H:%M:%S", "%a %b %d %I:%M:%S %p %Y"),
    *("%b %d %H:%M:%S %Y", "%d %b %Y %H:%M:%S"),
)
_MILLION = 1_000_000


class _AscHeader:
    """What a header said, and the time so far."""

    def __init__(self) -> None:
        self.start_us = 0
        self.base = 16
        self.relative = False
        self.now_us = 0
        self.names: dict[str, str] = {}

    def channel(self, bus: str) -> str:
        """The name of a bus."""
        return self.names.get(bus, f"can{bus}")


def read_asc(lines: Iterable[bytes], faults: LogFaults) -> Iterator[tuple[int, RawFrame]]:
    """Frames with their line numbers; a line that is neither a frame nor the format's own is counted."""
    state = _AscHeader()
    for number, raw in enumerate(lines, 1):
        line = raw.decode("utf-8", "replace").strip()
        if not line:
            continue
        if _NO_FRAME.match(line):
            _header(line, state)
            continue
        found = LogFault.CUT if not raw.endswith(b"\n") else _frame(line, state)
        if isinstance(found, LogFault):
            faults.add(found, number)
        else:
            yield number, found


def _header(line: str, state: _AscHeader) -> None:
    words = line.lower().split()
    if (named := _NAMED.fullmatch(line)) is not None:
        state.names[named[1]] = named[2]
    elif words[0] == "date":
        state.start_us = _date_us(line[4:])
    elif words[0] == "base":
        state.base = 10 if words[1:2] == ["dec"] else 16
        state.relative = "relative" in words


def _date_us(text: str) -> int:
    """A date as microseconds since the epoch, 0 where it is of no known form."""
    plain = " ".join(_ZONES.sub(" ", text).split())
    fraction = re.search(r":\d\d\.(\d{1,6})", plain)
    if fraction is not None:
        plain = plain.replace(f".{fraction[1]}", "", 1)
    for form in _DATES:
        try:
            seconds = calendar.timegm(time.strptime(plain, form))
        except ValueError:
            continue
        return seconds * _MILLION + (int(fraction[1].ljust(6, "0")) if fraction is not None else 0)
    return 0


def _frame(line: str, state: _AscHeader) -> RawFrame | LogFault:
    timed = _TIMED.fullmatch(line)
    if timed is None:
        return LogFault.NOT_A_LINE
    stamp_us = int(timed[1]) * _MILLION + int(timed[2].ljust(6, "0")[:6])
    state.now_us = state.now_us + stamp_us if state.relative else stamp_us
    time_us = state.start_us + state.now_us
    if match := _CLASSIC.match(timed[3]):
        return _classic(time_us, match, state)
    if match := _FLEXIBLE.match(timed[3]):
        return _flexible(time_us, match, state)
    if match := _ERROR.match(timed[3]):
        return RawFrame(time_us, state.channel(match[1]), _ERROR_CLASS_BUS, bytes(8), is_error=True)
    return LogFault.NOT_A_LINE


def _classic(time_us: int, match: re.Match[str], state: _AscHeader) -> RawFrame | LogFault:
    number, digits, long, direction, kind, length, rest = match.groups()
    base, bus = state.base, state.channel(number)
    can_id, sent = _identifier(digits, long, base), direction.lower() != "rx"
    if can_id is None:
        return LogFault.IDENTIFIER
    size = min(int(length or "0", 16), CAN_MAX_DLC)
    if kind.lower() == "r":
        return RawFrame(time_us, bus, can_id, b"", bool(long), True, False, size, None, sent)
    data = _data(rest, size, base)
    return LogFault.DATA if data is None else RawFrame(time_us, bus, can_id, data, bool(long), sent=sent)


def _flexible(time_us: int, match: re.Match[str], state: _AscHeader) -> RawFrame | LogFault:
    number, direction, digits, long, faster, error_state, code, length, rest = match.groups()
    base, bus = state.base, state.channel(number)
    can_id, sent = _identifier(digits, long, base), direction.lower() != "rx"
    if can_id is None:
        return LogFault.IDENTIFIER
    flags: int | None = CANFD_FDF | CANFD_BRS * (faster == "1") | CANFD_ESI * (error_state == "1")
    data = _data(rest, int(length), base) if int(length) <= CANFD_MAX_LEN else None
    if data is None:
        return LogFault.DATA
    marks = _marks(rest.split()[len(data) :])
    if not marks & _FLEXIBLE_MARK:
        flags = None
        if marks & _REMOTE_MARK:
            return RawFrame(time_us, bus, can_id, b"", bool(long), True, False, int(code, 16), None, sent)
    return RawFrame(time_us, bus, can_id, data, bool(long), fd_flags=flags, sent=sent)


def _marks(words: list[str]) -> int:
    """Flags of a CANFD line; one that is cut short is taken for a CAN FD frame."""
    try:
        return int(words[2], 16)
    except (IndexError, ValueError):
        return _FLEXIBLE_MARK


def _identifier(digits: str, long: str, base: int) -> int | None:
    try:
        can_id = int(digits, base)
    except ValueError:
        return None
    return can_id if can_id <= (CAN_EFF_MASK if long else CAN_SFF_MASK) else None


def _data(rest: str, size: int, base: int) -> bytes | None:
    words = rest.split()[:size]
    try:
        data = bytes(int(word, base) for word in words)
    except ValueError:
        return None
    return data if len(data) == size else None

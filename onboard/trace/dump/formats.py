"""Frames as candump prints them, byte for byte (can-utils 2020.11, ``candump.c`` and ``lib.c``)."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from operator import add
from typing import TYPE_CHECKING

from onboard.core.frame import CAN_MAX_DLC
from onboard.trace.candump import ERROR_FLAG
from onboard.trace.dump.error_frames import describe
from onboard.trace.raw import CANFD_BRS, CANFD_ESI, RawFrame

if TYPE_CHECKING:
    from onboard.trace.columns.block import FrameBlock

_MILLION = 1_000_000
_RESET = "\x1b[0m"
#: The colours of channels, in the order in which they are first seen (``col_on`` of candump.c).
_COLOURS = ("\x1b[1m\x1b[34m", "\x1b[1m\x1b[31m", "\x1b[1m\x1b[32m", "\x1b[1m", "\x1b[1m\x1b[35m", "\x1b[1m\x1b[36m")
#: The column of data, and where the ASCII column or the word ERRORFRAME ends behind eight bytes.
_HEX_WIDTH, _BINARY_WIDTH = 3, 9
_ASCII_GAP, _ERROR_GAP = 4, 13
_EXTRA = {0: "- -", CANFD_BRS: "B -", CANFD_ESI: "- E", CANFD_BRS | CANFD_ESI: "B E"}
_COLOUR_ALL = 2


class TimeFormat(StrEnum):
    """``-t``: absolute, delta, since the first frame, absolute with date; NONE prints no time."""

    NONE = ""
    ABSOLUTE = "a"
    DELTA = "d"
    ZERO = "z"
    DATE = "A"


@dataclass(frozen=True, slots=True)
class Look:
    """candump's letters: ``colour`` counts ``-c``; ``log`` is ``-L``, ``extra`` -x, ``ascii`` -a, ``swap`` -S."""

    stamp: TimeFormat = TimeFormat.NONE
    log: bool = False
    colour: int = 0
    extra: bool = False
    ascii: bool = False
    swap: bool = False
    binary: bool = False
    errors: bool = False


class Screen:
    """Formats frames one after the other.

    It remembers the width of names, the last time, each channel's colour, and whether a 29-bit identifier was seen:
    from then on 11-bit ones are indented.
    """

    def __init__(self, look: Look, channels: tuple[str, ...] = ()) -> None:
        """``channels``: those asked for by name, in their order."""
        self._look = look
        self._width = max(map(len, channels), default=0)
        self._colours = {name: number for number, name in enumerate(channels)}
        self._indent = False
        self._last_us: int | None = None
        #: For ``prefix``: channels as they are padded, the second that was told last, and how a line in it begins.
        self._names: dict[str, str] = {}
        self._is_absolute = look.stamp is TimeFormat.ABSOLUTE
        self._second, self._begins = -1, ""

    def text(self, frame: RawFrame) -> str:
        """The line of a frame, or its two lines where it is an error frame with its words; without the last end."""
        name = frame.channel
        number = self._colours.setdefault(name, len(self._colours))
        if len(name) > self._width:
            self._width = len(name)
            self._names.clear()
        if self._look.log:
            return log_line(frame, width=self._width, extra=self._look.extra)
        self._indent |= frame.is_extended
        look, on = self._look, _COLOURS[number % len(_COLOURS)]
        extra = ""
        if look.extra:
            direction = "RX" if frame.sent is False else "TX"
            extra = f"  {direction} {_EXTRA[(frame.fd_flags or 0) & (CANFD_BRS | CANFD_ESI)]}"
        line = (
            f" {on if look.colour > _COLOUR_ALL else ''}{self._time(frame.time_us)}"
            f" {on if 0 < look.colour <= _COLOUR_ALL else ''}{name:>{self._width}}{extra}"
            f"{_RESET if look.colour == 1 else ''}  {self._frame(frame)}{_RESET if look.colour > 1 else ''}"
        )
        if frame.is_error and look.errors:
            line += f"\n\t{describe(frame)}"
        return line

    def prefix(self, time_us: int, channel: str) -> str:
        """What stands before the words of a decoded message: time and channel."""
        name = self._names.get(channel) or self._padded(channel)
        if not self._is_absolute:
            return f" {self._time(time_us)}{name}"
        second, microseconds = divmod(time_us, _MILLION)
        if second != self._second:
            self._second, self._begins = second, f" ({second:010d}."
        return f"{self._begins}{microseconds:06d}) {name}"

    def prefixes(self, block: "FrameBlock") -> Iterable[str] | None:
        """The same for each frame of a block; None where one depends on which of those before it are shown."""
        from onboard.trace.columns.stamps import stamps  # noqa: PLC0415  # a board has no numpy, and no blocks

        if not self._is_absolute or max(map(len, block.channels), default=0) > self._width:
            return None
        times = stamps(block.time_us)
        if times is None:
            return None
        names = [self._padded(channel) for channel in block.channels]
        return map(add, times, map(names.__getitem__, block.channel.tolist()))

    def _padded(self, channel: str) -> str:
        if len(channel) > self._width:
            self._width = len(channel)
            self._names.clear()
        name = self._names[channel] = f" {channel:<{self._width}}  "
        return name

    def _time(self, time_us: int) -> str:
        seconds, microseconds = divmod(time_us, _MILLION)
        match self._look.stamp:
            case TimeFormat.NONE:
                return ""
            case TimeFormat.ABSOLUTE:
                return f"({seconds:010d}.{microseconds:06d}) "
            case TimeFormat.DATE:
                return f"({time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(seconds))}.{microseconds:06d}) "
        before = time_us if self._last_us is None else self._last_us
        if self._look.stamp is TimeFormat.DELTA or self._last_us is None:
            self._last_us = time_us
        seconds, microseconds = divmod(max(0, time_us - before), _MILLION)
        return f"({seconds:03d}.{microseconds:06d}) "

    def _frame(self, frame: RawFrame) -> str:
        if frame.is_error:
            head = f"{frame.can_id | ERROR_FLAG:08X}"
        elif frame.is_extended:
            head = f"{frame.can_id:08X}"
        else:
            head = f"     {frame.can_id:03X}" if self._indent else f"{frame.can_id:03X}"
        if frame.fd_flags is not None:
            return self._with_data(f"{head}  [{frame.length:02d}] ", frame)
        head = f"{head}   [{frame.length}] "
        return f"{head} remote request" if frame.is_remote else self._with_data(head, frame)

    def _with_data(self, head: str, frame: RawFrame) -> str:
        look = self._look
        data = frame.data[::-1] if look.swap else frame.data
        words = [f"{byte:08b}" if look.binary else f"{byte:02X}" for byte in data]
        text = head + (" " + ("`" if look.swap else " ").join(words) if words else "")
        missing = (_BINARY_WIDTH if look.binary else _HEX_WIDTH) * (CAN_MAX_DLC - len(data))
        if missing < 0:
            return text
        if frame.is_error:
            return text + "ERRORFRAME".rjust(missing + _ERROR_GAP)
        if look.ascii:
            quote = "`" if look.swap else "'"
            return text + quote.rjust(missing + _ASCII_GAP) + _printable(data) + quote
        return text


def log_line(frame: RawFrame, *, width: int = 0, extra: bool = False) -> str:
    """A line of ``candump -L``, every kind of frame kept as it came; ``extra`` adds the mark of direction."""
    seconds, microseconds = divmod(frame.time_us, _MILLION)
    mark = (" R" if frame.sent is False else " T") if extra else ""
    return f"({seconds:010d}.{microseconds:06d}) {frame.channel:>{width}} {log_frame(frame)}{mark}"


def log_frame(frame: RawFrame) -> str:
    """The part of a log line that is the frame: ``18FF0201#08C3``, ``123##4AABB``, ``100#R2``."""
    if frame.is_error:
        head = f"{frame.can_id | ERROR_FLAG:08X}"
    else:
        head = f"{frame.can_id:08X}" if frame.is_extended else f"{frame.can_id:03X}"
    if frame.is_remote:
        return f"{head}#R{frame.remote_dlc or ''}"
    if frame.fd_flags is not None:
        return f"{head}##{frame.fd_flags:X}{frame.data.hex().upper()}"
    return f"{head}#{frame.data.hex().upper()}"


def _printable(data: bytes) -> str:
    return "".join(chr(byte) if 0x1F < byte < 0x7F else "." for byte in data)


def time_of_name(time_us: int) -> str:
    """The name that ``candump -l`` gives a log begun at this time, in local time."""
    return time.strftime("candump-%Y-%m-%d_%H%M%S.log", time.localtime(time_us // _MILLION))

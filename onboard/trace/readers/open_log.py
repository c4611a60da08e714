"""A log of any format that we read, told apart by its first bytes; in bounded memory, with a bar where one looks."""

import io
import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache
from itertools import chain, islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self, TextIO, cast

from onboard.trace.raw import RawFrame
from onboard.trace.readers.asc import read_asc
from onboard.trace.readers.candump import read_candump
from onboard.trace.readers.faults import LogFaults
from onboard.trace.readers.guess import guess
from onboard.trace.readers.pcapng import MAGIC, read_pcapng

if TYPE_CHECKING:
    from onboard.trace.columns.block import FrameBlock

_ASC = re.compile(rb"\s*(date\s|base\s+(hex|dec)|//\s*version|begin\s+trigger)", re.IGNORECASE)
_BAR_PERIOD_S = 0.2
_BAR_WIDTH = 30
#: What is read at once, bytes, and what is worth reading by columns: a live bus brings less.
_PIECE_BYTES, _LEAST_BYTES = 1 << 19, 1 << 14
#: Longest line, bytes; one of CAN FD in ASC has some four hundred. A hole that a power cut left in a log is one line of
#: zeros, however long: it is counted, and not kept.
LONGEST_LINE = 1 << 16
#: Frames of other formats that are handed on together.
_STRETCH = 1 << 16
#: A pipe has no length; what it holds so far is told instead.
_MEGABYTE = 1_000_000


class LogOpenError(ValueError):
    """A log that cannot be read; the text is one clear line."""


class Log:
    """Frames of a log, one after the other. A context manager; ``faults`` tells afterwards what was wrong with it.

    Reading raises ``LogOpenError`` at the end of a file that holds nothing of any format that we read.
    """

    def __init__(self, name: str, *, bar: TextIO | None = None) -> None:
        """``name`` is a path, or - for standard input. ``bar``: where to draw progress, if it is a terminal.

        Raises ``LogOpenError`` where it cannot be read.
        """
        self.name = name
        self.faults = LogFaults()
        self._bar = bar if bar is not None and bar.isatty() else None
        try:
            # Typed as a file of any kind, standard input is the one that there is.
            stdin = cast("io.BufferedIOBase", sys.stdin.buffer)
            self._file: io.BufferedIOBase = stdin if name == "-" else Path(name).open("rb")  # noqa: SIM115  # closed by __exit__
        except OSError as error:
            raise LogOpenError(f"{name}: cannot be read ({error.strerror}); name an existing log") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not sys.stdin.buffer:
            self._file.close()

    def __iter__(self) -> Iterator[RawFrame]:
        return chain.from_iterable(portion.frames for portion in self.portions())

    def portions(self) -> "Iterator[Portion]":
        """The same frames some at a time: by columns where many are there already; those of a live bus one by one."""
        with self._watched() as watched:
            placed = self._placed(watched)
            if placed is not None:
                yield Portion(None, self.faults.watch(placed))
                self._check(watched.first_line)
                return
            for text in self._texts(watched):
                read_block = _block_reader() if text.is_whole and len(text.lines) >= _LEAST_BYTES else None
                if read_block is not None:
                    yield Portion(read_block(text.lines, text.first, self.faults))
                else:
                    ones = read_candump(io.BytesIO(text.lines), self.faults, text.first)
                    yield Portion(None, self.faults.watch(ones))

    def one_by_one(self) -> Iterator[RawFrame]:
        """The same frames, but nothing of the log is looked at behind the one that is asked for."""
        with self._watched() as watched:
            placed = self._placed(watched)
            yield from self.faults.watch(placed if placed is not None else read_candump(watched, self.faults))
            self._check(watched.first_line)

    def stretches(self) -> "Iterator[LogText | list[tuple[int, RawFrame]]]":
        """The log in pieces for who reads it by columns: text of candump, or frames with their places."""
        with self._watched() as watched:
            placed = self._placed(watched)
            if placed is None:
                yield from self._texts(watched)
                return
            while stretch := list(islice(placed, _STRETCH)):
                yield stretch
            self._check(watched.first_line)

    def _watched(self) -> "_Watched":
        return _Watched(self._file, self._bar)

    def _placed(self, watched: "_Watched") -> Iterator[tuple[int, RawFrame]] | None:
        """Frames of every format but candump's, with their places; None for what is read as candump's."""
        head = watched.first_line
        if head[: len(MAGIC)] == MAGIC:
            return read_pcapng(watched.read, self.faults)
        if head.startswith((b"LOGG", b";$FILEVERSION")):
            from onboard.trace.readers.python_can import BLF_MAGIC, read_blf, read_trc  # noqa: PLC0415  # for these only

            return (read_blf if head.startswith(BLF_MAGIC) else read_trc)(watched.read, self.faults)
        if len(head) > LONGEST_LINE:
            raise self._no_log(head)
        return read_asc(watched, self.faults) if _ASC.match(head) else None

    def _texts(self, watched: "_Watched") -> "Iterator[LogText]":
        number = 1
        for piece in watched.pieces():
            yield LogText(number, piece)
            number += piece.count(b"\n")
        self._check(watched.first_line)

    def _check(self, head: bytes) -> None:
        """What says of itself no other format must have had a frame of candump's."""
        if not head:
            raise LogOpenError(f"{self.name}: is empty; name a log that something was written to")
        if self.faults.is_no_log:
            raise self._no_log(head)

    def _no_log(self, head: bytes) -> LogOpenError:
        known = "candump -L, Vector ASC and BLF, PEAK TRC, pcapng"
        return LogOpenError(f"{self.name}: no frame of a log that we read ({known}); {guess(head)}")


@cache
def _block_reader() -> "Callable[[bytes, int, LogFaults], FrameBlock] | None":
    """What reads many lines at once; None where there is no numpy, as on a board."""
    try:
        from onboard.trace.columns.candump_text import read_block  # noqa: PLC0415  # short logs do without numpy
    except ImportError:
        return None
    return read_block


class Portion(NamedTuple):
    """Frames of a log, in its order: a stretch by columns, or else ``ones``, which may still be on their way."""

    block: "FrameBlock | None"
    ones: Iterator[RawFrame] = iter(())

    @property
    def frames(self) -> Iterator[RawFrame]:
        """The frames one by one."""
        return self.ones if self.block is None else self.block.frames()


class LogText(NamedTuple):
    """A stretch of a candump log: the number of its first line, and its lines with their ends."""

    first: int
    lines: bytes

    @property
    def is_whole(self) -> bool:
        """Whether the last line has its end."""
        return self.lines.endswith(b"\n")


class _Watched:
    """A binary file that tells how far it was read."""

    def __init__(self, file: io.BufferedIOBase, bar: TextIO | None) -> None:
        self._file = file
        self._bar = bar
        self._done = 0
        self._shown_s = time.monotonic()
        self._total = os.fstat(file.fileno()).st_size if bar is not None else 0
        #: The first line; it is read again afterwards. A binary log's first bytes hold a line's end.
        self.first_line = self._file.read(len(MAGIC))
        if self.first_line != MAGIC and not self.first_line.endswith(b"\n"):
            self.first_line += self._file.readline(LONGEST_LINE)
        self._first = self.first_line

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wipe the bar, where all was read."""
        if kind is None and self._bar is not None:
            self._bar.write("\r\x1b[K")
            self._bar.flush()

    def __iter__(self) -> Iterator[bytes]:
        first, self._first = self._first, b""
        self._done += len(first)
        yield from first.splitlines(keepends=True)
        while line := self._file.readline(LONGEST_LINE):
            self._done += len(line)
            if self._bar is not None:
                self._show()
            yield line
            while len(line) == LONGEST_LINE and not line.endswith(b"\n"):
                # The rest of it is no line of its own.
                line = self._file.readline(LONGEST_LINE)
                self._done += len(line)

    def read(self, size: int) -> bytes:
        """As a file's ``read``."""
        data, self._first = self._first[:size], self._first[size:]
        if len(data) < size:
            data += self._file.read(size - len(data))
        self._done += len(data)
        if self._bar is not None:
            self._show()
        return data

    def pieces(self) -> Iterator[bytes]:
        """Whole lines, as many as there are at once; at the end what has no end of a line."""
        waiting, self._first = self._first, b""
        self._done += len(waiting)
        while piece := self._file.read1(_PIECE_BYTES):
            self._done += len(piece)
            if self._bar is not None:
                self._show()
            end = piece.rfind(b"\n") + 1
            if not end:
                waiting += piece if len(waiting) <= LONGEST_LINE else b""
                continue
            yield waiting + piece[:end]
            waiting = piece[end:]
        end = waiting.rfind(b"\n") + 1
        yield from (part for part in (waiting[:end], waiting[end:]) if part)

    def _show(self) -> None:
        now_s = time.monotonic()
        if now_s - self._shown_s < _BAR_PERIOD_S or self._bar is None:
            return
        self._shown_s = now_s
        if self._total:
            share = min(1.0, self._done / self._total)
            filled = round(share * _BAR_WIDTH)
            text = f"[{'#' * filled}{'.' * (_BAR_WIDTH - filled)}] {share:4.0%}"
        else:
            text = f"{self._done / _MEGABYTE:.1f} MB"
        self._bar.write(f"\r{text}")
        self._bar.flush()

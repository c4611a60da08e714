"""A log of any format that we read, told apart by its first bytes; in bounded memory, with a bar where one looks."""

import os
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self, TextIO

from onboard.trace.raw import RawFrame
from onboard.trace.readers.asc import read_asc
from onboard.trace.readers.candump import read_candump
from onboard.trace.readers.faults import LogFaults
from onboard.trace.readers.guess import guess
from onboard.trace.readers.pcapng import MAGIC, read_pcapng

_ASC = re.compile(rb"\s*(date\s|base\s+(hex|dec)|//\s*version|begin\s+trigger)", re.IGNORECASE)
_BAR_PERIOD_S = 0.2
_BAR_WIDTH = 30
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
            self._file: BinaryIO = sys.stdin.buffer if name == "-" else Path(name).open("rb")  # noqa: SIM115  # closed by __exit__
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
        watched = _Watched(self._file, self._bar)
        head = watched.head()
        if head[: len(MAGIC)] == MAGIC:
            yield from self.faults.watch(read_pcapng(watched.read, self.faults))
        elif _ASC.match(head):
            yield from self.faults.watch(read_asc(watched, self.faults))
        else:
            yield from self.faults.watch(read_candump(watched, self.faults))
            self._check(head)
        watched.finish()

    def _check(self, head: bytes) -> None:
        """What says of itself no other format must have had a frame of candump's."""
        if not head:
            raise LogOpenError(f"{self.name}: is empty; name a log that something was written to")
        if self.faults.is_no_log:
            known = "candump -L, Vector ASC, pcapng"
            raise LogOpenError(f"{self.name}: no frame of a log that we read ({known}); {guess(head)}")


class _Watched:
    """A binary file that tells how far it was read."""

    def __init__(self, file: BinaryIO, bar: TextIO | None) -> None:
        self._file = file
        self._bar = bar
        self._done = 0
        self._shown_s = time.monotonic()
        self._total = os.fstat(file.fileno()).st_size if bar is not None else 0
        self._first = b""

    def head(self) -> bytes:
        """The first line; it is read again afterwards. A binary log's first bytes hold a line's end."""
        self._first = self._file.read(len(MAGIC))
        if self._first != MAGIC and not self._first.endswith(b"\n"):
            self._first += self._file.readline()
        return self._first

    def __iter__(self) -> Iterator[bytes]:
        first, self._first = self._first, b""
        self._done += len(first)
        yield from first.splitlines(keepends=True)
        for line in self._file:
            self._done += len(line)
            if self._bar is not None:
                self._show()
            yield line

    def read(self, size: int) -> bytes:
        """As a file's ``read``."""
        data, self._first = self._first[:size], self._first[size:]
        if len(data) < size:
            data += self._file.read(size - len(data))
        self._done += len(data)
        if self._bar is not None:
            self._show()
        return data

    def finish(self) -> None:
        """Wipe the bar."""
        if self._bar is not None:
            self._bar.write("\r\x1b[K")
            self._bar.flush()

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

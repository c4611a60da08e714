"""``ports.Journal`` in a directory: an append-only file, one checked line a record.

A line is ``CRC NUMBER ENTRY``: CRC-32 (ISO 3309, as in zlib) over the rest in eight hex digits, a number that counts
from one, and the entry as JSON with sorted keys. So a person can read it, and a torn write shows.
"""

import asyncio
import fcntl
import json
import os
import zlib
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from onboard.ports.journal import Entry

FILE_NAME = "journal.log"
_FIELDS = 3


class JournalDamagedError(OSError):
    """A record that was durably written cannot be read any more; ``str`` is one line for a person."""


class FileJournal:
    """The journal of one controller. One process holds a directory at a time.

    Writes happen in one thread of its own, in the order of the calls; each is followed by ``fdatasync``. A write that
    fails (disk full) is taken back, and later ones may succeed; once a sync has failed nothing more is accepted, for
    Linux may have thrown the data away and report success the next time.
    """

    def __init__(self, directory: Path) -> None:
        """Open or create. Raises ``OSError``: no such place, no right, or another process holds it."""
        self.torn = 0
        self._path = directory / FILE_NAME
        directory.mkdir(parents=True, exist_ok=True)
        self._lock = _hold(directory / "lock")
        self._file = _open_to_append(self._path)
        self._records = 0
        self._broken: OSError | None = None
        self._replayed = False
        self._writer = ThreadPoolExecutor(1, "journal")
        self._closed = False

    @property
    def size_bytes(self) -> int:
        """Length of the file: what ``compact`` is decided by."""
        return os.fstat(self._file).st_size

    def replay(self) -> list[Entry]:
        """All entries, oldest first. A torn last record is cut off and counted in ``torn``.

        Raises ``JournalDamagedError`` where a record in the middle is not as it was written: rights may have been
        forgotten, so the machine must not start with what is left.
        """
        content = self._path.read_bytes()
        entries, good, damaged = _parse(content)
        if damaged:
            raise JournalDamagedError(
                f"{self._path}: record {len(entries) + 1} is damaged and later ones are not: the medium has failed; "
                "let a person regenerate this machine's tokens, then move the file away"
            )
        if good < len(content):
            self.torn += 1
            os.ftruncate(self._file, good)
            os.fdatasync(self._file)
        self._records = len(entries)
        self._replayed = True
        return entries

    async def append(self, entry: Entry) -> None:
        """As in the port. ``replay`` must have been called once."""
        assert self._replayed, "replay() comes first: it cuts off a torn record"
        await self._in_writer(lambda: self._append(entry))

    async def compact(self, entries: Iterable[Entry]) -> None:
        """Replace all records by ``entries``, which must mean the same; at once or, after a power cut, not at all.

        Raises ``OSError`` as ``append`` does; the old file then still stands.
        """
        kept = list(entries)
        await self._in_writer(lambda: self._compact(kept))

    async def close(self) -> None:
        """Finish pending writes and give the directory back."""
        if self._closed:
            return
        self._closed = True
        await asyncio.get_running_loop().run_in_executor(None, self._writer.shutdown)
        for descriptor in (self._file, self._lock):
            os.close(descriptor)

    async def _in_writer(self, work: Callable[[], None]) -> None:
        # A controller that is cancelled while it waits must not leave the write half-done: shielded.
        await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._writer, work))

    # --- in the writer's thread --------------------------------------------------------------------------------

    def _append(self, entry: Entry) -> None:
        self._check()
        before = self.size_bytes
        try:
            _write_all(self._file, _line(self._records + 1, entry))
        except OSError:
            self._take_back(before)
            raise
        try:
            os.fdatasync(self._file)
        except OSError as error:
            self._broken = error
            raise
        self._records += 1

    def _compact(self, entries: list[Entry]) -> None:
        self._check()
        temporary = self._path.with_suffix(".new")
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND | os.O_CLOEXEC, 0o644)
        try:
            for number, entry in enumerate(entries, 1):
                _write_all(descriptor, _line(number, entry))
            os.fdatasync(descriptor)
            temporary.replace(self._path)
        except OSError:
            os.close(descriptor)
            raise
        os.close(self._file)
        self._file, self._records = descriptor, len(entries)
        try:
            _sync_directory(self._path.parent)
        except OSError as error:
            self._broken = error
            raise

    def _check(self) -> None:
        if self._broken is not None:
            raise OSError(self._broken.errno, f"an earlier write failed: {self._broken.strerror}") from self._broken

    def _take_back(self, size: int) -> None:
        """Cut off what was written of a record; a record after a torn one would look like damage."""
        try:
            os.ftruncate(self._file, size)
        except OSError as error:
            self._broken = error


def _hold(path: Path) -> int:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise OSError(
            error.errno, "another controller uses this journal; stop it, or name another directory", str(path)
        ) from error
    return descriptor


def _open_to_append(path: Path) -> int:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
    # The name itself must survive a power cut, or the first records would be durable in a file without a name.
    _sync_directory(path.parent)
    return descriptor


def _sync_directory(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def _line(number: int, entry: Entry) -> bytes:
    body = f"{number} {json.dumps(dict(entry), sort_keys=True, separators=(',', ':'))}".encode()
    return b"%08x %s\n" % (zlib.crc32(body), body)


def _parse(content: bytes) -> tuple[list[Entry], int, bool]:
    """Entries, the bytes that they take, and whether a good record stands behind a bad one, or out of turn."""
    entries: list[Entry] = []
    *lines, rest = (line + b"\n" for line in content.split(b"\n"))
    if rest != b"\n":
        lines.append(rest[:-1])
    good = 0
    for index, line in enumerate(lines):
        entry = _entry(line, len(entries) + 1)
        if entry is None:
            return entries, good, any(_entry(later, None) is not None for later in lines[index:])
        entries.append(entry)
        good += len(line)
    return entries, good, False


def _entry(line: bytes, number: int | None) -> Entry | None:
    """The entry of a line, or None where it is not as it was written, or not the one with ``number``."""
    fields = line.rstrip(b"\n").split(b" ", _FIELDS - 1)
    if len(fields) != _FIELDS or not line.endswith(b"\n"):
        return None
    if fields[0] != b"%08x" % zlib.crc32(b" ".join(fields[1:])):
        return None
    if number is not None and fields[1] != b"%d" % number:
        return None
    entry: Entry = json.loads(fields[2])
    return entry

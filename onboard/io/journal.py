"""``ports.Journal`` in a directory: one append-only file, sealed (onboard/io/sealed.py says what is in it).

A person can read it; a torn write costs nothing that was confirmed; a file that lost anything at its end, or comes from
elsewhere, is found by its seal. One ``fdatasync`` makes a record durable together with its seal.
"""

import asyncio
import errno
import fcntl
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from onboard.bounded_file import read_bounded
from onboard.core.journal_state import JournalCondition, JournalState
from onboard.io.sealed import MOST_LINE, MOST_RECORDS, Appending, Reading, Tail, begin, read
from onboard.ports.journal import Compaction, Entry

FILE_NAME = "journal.log"
#: A journal is worth writing anew from this size on, bytes: less is read in a moment (1,000 records in 10 ms).
LEAST_BYTES = 256_000
#: And only when it has grown by this factor since: writing anew then costs less than all appends did.
GROWTH = 2
#: Longest journal that is read and written, bytes: a gateway's with all the reports that it keeps (20,000) has two
#: thirds of it, a controller's 200,000 records without a moment in which it could be written anew.
MOST_BYTES = 32_000_000
_IDENTITY_BYTES = 8


class JournalDamagedError(OSError):
    """The journal cannot be relied on, so nothing is appended to it; ``str`` is one line for a person."""


def new_identity() -> str:
    """What tells one journal from every other: 64 bits by chance."""
    return os.urandom(_IDENTITY_BYTES).hex()


class FileJournal:
    """The journal of one controller. One process holds a directory at a time. ``owner`` is whose journal it must be.

    Writes happen in one thread of its own, in the order of the calls. A write that fails (disk full) is taken back,
    and later ones may succeed; once a sync has failed nothing more is accepted, for Linux may have thrown the data away
    and report success the next time.
    """

    def __init__(self, directory: Path, owner: str, identity: Callable[[], str] = new_identity) -> None:
        """Open or create. Raises ``OSError``: no such place, no right, or another process holds it."""
        self.owner = owner
        self.condition = JournalCondition()
        self._identity = identity
        self._path = directory / FILE_NAME
        directory.mkdir(parents=True, exist_ok=True)
        self._lock = _hold(directory / "lock")
        self._file: int | None = None
        self._tail: Tail | None = None
        self._least = LEAST_BYTES
        self._broken: OSError | None = None
        self._writer = ThreadPoolExecutor(1, "journal")
        self._closed = False

    @property
    def name(self) -> str:
        """How a person finds it."""
        return str(self._path)

    @property
    def size_bytes(self) -> int:
        """Length of the file, 0 where there is none yet."""
        return self._tail.end if self._tail is not None else 0

    @property
    def has_grown(self) -> bool:
        """Whether the file is beyond ``LEAST_BYTES``, and ``GROWTH`` times what it was when last written anew."""
        return self.size_bytes > self._least

    def replay(self) -> list[Entry]:
        """As in the port. A torn last record is cut off, and records that have a second copy are restored.

        A journal that is short or foreign is left exactly as it is, for a person to look at. Raises ``OSError`` for
        one that cannot be read.
        """
        try:
            content = read_bounded(self._path, MOST_BYTES)
        except FileNotFoundError:
            self.condition = JournalCondition(JournalState.NEW)
            self._write_whole([])
            return []
        except OSError as error:
            if error.errno != errno.EFBIG:
                raise
            why = f"{self._path}: {error.strerror}, which no journal of ours becomes"
            self.condition = JournalCondition(JournalState.SHORT, None, 0, why)
            return []
        reading = read(content, self.owner, str(self._path))
        self.condition = reading.condition
        if reading.is_old_form and reading.condition.is_reliable:
            self._write_whole(reading.entries)
        elif reading.tail is not None:
            self._file, self._tail = os.open(self._path, os.O_RDWR | os.O_CLOEXEC), reading.tail
            self._mend(self._file, content, reading)
        return reading.entries

    async def append(self, entry: Entry) -> None:
        """Write in the journal's own thread. ``replay`` must have been called once. Raises ``OSError``."""
        await self._in_writer(lambda: self._append(entry))

    async def compact(self, fewer: Compaction) -> None:
        """Write another file, rename it over this one. Raises ``OSError``, ``JournalDamagedError`` for a bad one."""
        await self._in_writer(lambda: self._compact(fewer))

    async def renew(self, entries: Iterable[Entry]) -> None:
        """As in the port; the file that was there gets the name ``journal.log.1``, or the next number that is free."""
        kept = list(entries)
        await self._in_writer(lambda: self._renew(kept))

    async def close(self) -> None:
        """Finish pending writes and give the directory back."""
        if self._closed:
            return
        self._closed = True
        await asyncio.get_running_loop().run_in_executor(None, self._writer.shutdown)
        for descriptor in (self._file, self._lock):
            if descriptor is not None:
                os.close(descriptor)

    async def _in_writer(self, work: Callable[[], None]) -> None:
        # A controller that is cancelled while it waits must not leave the write half-done: shielded.
        await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._writer, work))

    def _mend(self, file: int, content: bytes, reading: Reading) -> None:
        if reading.end == len(content) and not reading.mending:
            return
        os.ftruncate(file, reading.end)
        _write_all(file, reading.mending, reading.end)
        os.fdatasync(file)

    # --- in the writer's thread --------------------------------------------------------------------------------

    def _append(self, entry: Entry) -> None:
        file, tail = self._ready()
        appending = tail.appending(entry)
        _check_bounds(appending, tail.records + 1)
        try:
            _write_all(file, appending.line.data, appending.line.offset)
            if appending.in_two:
                self._sync(file)
            _write_all(file, appending.slot.data, appending.slot.offset)
        except OSError:
            self._take_back(file, tail.end)
            raise
        self._sync(file)
        tail.take(appending)

    def _sync(self, file: int) -> None:
        try:
            os.fdatasync(file)
        except OSError as error:
            self._broken = error
            raise

    def _compact(self, fewer: Compaction) -> None:
        self._ready()
        reading = read(read_bounded(self._path, MOST_BYTES), self.owner, str(self._path))
        if not reading.condition.is_reliable:
            raise JournalDamagedError(reading.condition.why)
        self._write_whole(fewer(reading.entries))

    def _renew(self, entries: list[Entry]) -> None:
        number = 1
        while (aside := self._path.with_name(f"{FILE_NAME}.{number}")).exists():
            number += 1
        if self._path.exists():
            # A second name first: at no moment is there no journal, which would pass for a first life.
            os.link(self._path, aside)
            _sync_directory(self._path.parent)
        self._write_whole(entries)
        self.condition = JournalCondition()

    def _write_whole(self, entries: list[Entry]) -> None:
        """Another file with these entries takes the place of the old one, if any, in one step."""
        content, tail = begin(self.owner, self._identity(), entries)
        temporary = self._path.with_suffix(".new")
        descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
        try:
            _write_all(descriptor, content, 0)
            os.fsync(descriptor)
            temporary.replace(self._path)
        except OSError:
            os.close(descriptor)
            raise
        if self._file is not None:
            os.close(self._file)
        self._file, self._tail = descriptor, tail
        self._least = max(LEAST_BYTES, GROWTH * len(content))
        try:
            _sync_directory(self._path.parent)
        except OSError as error:
            # Which of the two a power cut leaves is not known: nothing more may be added to either.
            self._broken = error
            raise

    def _ready(self) -> tuple[int, Tail]:
        if self._broken is not None:
            raise OSError(self._broken.errno, f"an earlier write failed: {self._broken.strerror}") from self._broken
        if self._file is None or self._tail is None:
            raise JournalDamagedError(self.condition.why or "replay() comes first: it says how the journal is")
        return self._file, self._tail

    def _take_back(self, file: int, size: int) -> None:
        """Cut off what was written of a record; what follows a torn one could not be read."""
        try:
            os.ftruncate(file, size)
        except OSError as error:
            self._broken = error


def _check_bounds(appending: Appending, records: int) -> None:
    """What could not be read again is not written: the disk counts as full."""
    line = appending.line
    if len(line.data) > MOST_LINE or line.offset + len(line.data) > MOST_BYTES or records > MOST_RECORDS:
        raise OSError(errno.EFBIG, f"a journal takes {MOST_BYTES / 1e6:g} MB and {MOST_RECORDS:,} records")


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


def _sync_directory(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_all(descriptor: int, data: bytes, offset: int) -> None:
    while data:
        written = os.pwrite(descriptor, data, offset)
        data, offset = data[written:], offset + written

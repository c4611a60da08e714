"""A sealed journal on a medium in memory that charges simulated time for each write, as an SD card does.

Bytes and parser are those of the real one (onboard/io/sealed.py), so that a fault of the medium is judged by the code
that judges it on a board.
"""

import asyncio
import errno
from collections.abc import Callable, Iterable

from onboard.core.journal_state import JournalCondition, JournalState
from onboard.io.journal import GROWTH, LEAST_BYTES
from onboard.io.sealed import Appending, Tail, begin, read
from onboard.ports.journal import Compaction, Entry

#: One durable write of a small record on an SD card, us: cards differ by a factor of ten.
WRITE_US = 4_000
#: The whole journal written anew: some hundred kilobytes, a rename and two syncs, us.
COMPACT_US = 60_000


class SimulatedJournal:
    """``ports.Journal`` in virtual time. Its medium outlives the controller, so a restarted one can replay it.

    ``medium``: the bytes of the file, None where there is none. While ``is_full`` every write fails as on a full disk.
    ``on_write`` is called twice for each write, with False before and True after it is durable: a crash may strike at
    either moment. ``pending``: the append that is under way.
    """

    def __init__(self, owner: str = "simulated", *, entries: Iterable[Entry] = (), write_us: int = WRITE_US) -> None:
        self.owner = owner
        self.write_us = write_us
        self.condition = JournalCondition()
        self.is_full = False
        self.on_write: Callable[[bool], None] | None = None
        self.pending: Appending | None = None
        #: From this size on it is written anew, bytes.
        self.least_bytes = LEAST_BYTES
        self.medium: bytearray | None = None
        self._tail: Tail | None = None
        self._made = 0
        first = list(entries)
        if first:
            self._write_whole(first)

    @property
    def entries(self) -> list[Entry]:
        """What a replay would find, without its mending anything."""
        return read(bytes(self.medium), self.owner, self.name).entries if self.medium is not None else []

    @property
    def name(self) -> str:
        """How a person finds it."""
        return f"journal of {self.owner}"

    @property
    def has_grown(self) -> bool:
        """Whether the medium is beyond ``least_bytes``."""
        return self._tail is not None and self._tail.end > self.least_bytes

    def replay(self) -> list[Entry]:
        """As in the port; mending costs no time: the machine is not heard of yet."""
        if self.medium is None:
            self._write_whole([])
            self.condition = JournalCondition(JournalState.NEW)
            return []
        reading = read(bytes(self.medium), self.owner, self.name)
        self.condition, self._tail = reading.condition, reading.tail
        if reading.tail is not None:
            self.medium[reading.end :] = reading.mending
        return reading.entries

    async def append(self, entry: Entry) -> None:
        """Durable after ``write_us`` of virtual time. Raises ``OSError`` (ENOSPC) while the disk is full."""
        if self.medium is None:
            self.replay()
        if self._tail is None:
            raise OSError(errno.EIO, self.condition.why or "replay() comes first")
        tail, self.pending = self._tail, self._tail.appending(entry)
        await self._write(self.write_us)
        self._put(self.pending)
        tail.take(self.pending)
        self.pending = None
        self._written()

    async def compact(self, fewer: Compaction) -> None:
        """Write anew, which takes ``COMPACT_US`` of virtual time. Raises ``OSError`` where it is not reliable."""
        if self._tail is None:
            raise OSError(errno.EIO, self.condition.why or "replay() comes first")
        await self._write(COMPACT_US)
        self._write_whole(fewer(self.entries))
        assert self.medium is not None
        self.least_bytes = max(self.least_bytes, GROWTH * len(self.medium))
        self._written()

    async def renew(self, entries: Iterable[Entry]) -> None:
        """Begin anew with ``entries``, which takes ``COMPACT_US`` of virtual time; the old ones are gone."""
        await self._write(COMPACT_US)
        self._write_whole(entries)
        self.condition = JournalCondition()
        self._written()

    async def close(self) -> None:
        """The medium is memory, so there is nothing to give back."""

    def after_power_cut(self) -> "SimulatedJournal":
        """What the next controller finds: a write under way is lost, and does not come later either."""
        found = SimulatedJournal(self.owner, write_us=self.write_us)
        found.medium = None if self.medium is None else bytearray(self.medium)
        found.is_full, found.on_write, found.least_bytes = self.is_full, self.on_write, self.least_bytes
        found.pending, found._made = self.pending, self._made  # another of this class
        return found

    def _put(self, appending: Appending) -> None:
        assert self.medium is not None
        for offset, data in (appending.line, appending.slot):
            self.medium[offset : offset + len(data)] = data

    async def _write(self, cost_us: int) -> None:
        if self.on_write is not None:
            self.on_write(False)
        await asyncio.sleep(cost_us / 1_000_000)
        if self.is_full:
            self.pending = None
            raise OSError(errno.ENOSPC, "no space left on device")

    def _written(self) -> None:
        if self.on_write is not None:
            self.on_write(True)

    def _write_whole(self, entries: Iterable[Entry]) -> None:
        self._made += 1
        content, self._tail = begin(self.owner, f"{self._made:016x}", entries)
        self.medium = bytearray(content)

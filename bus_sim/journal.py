"""A journal in memory that charges simulated time for each write, as an SD card does."""

import asyncio
import errno
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.ports.journal import Entry

#: One durable write of a small record on an SD card, us. Ours: cards differ by a factor of ten.
WRITE_US = 4_000


@dataclass
class SimulatedJournal:
    """``ports.Journal`` in virtual time. ``entries`` outlives the controller, so a restarted one can replay it.

    While ``is_full`` every write fails as on a full disk. ``on_write`` is called twice for each write, with False
    before and True after it is durable: a crash may strike at either moment.
    """

    write_us: int = WRITE_US
    entries: list[Entry] = field(default_factory=list)
    is_full: bool = False
    on_write: Callable[[bool], None] | None = None

    def replay(self) -> list[Entry]:
        """All entries, oldest first."""
        return list(self.entries)

    async def append(self, entry: Entry) -> None:
        """Durable after ``write_us`` of virtual time. Raises ``OSError`` (ENOSPC) while the disk is full."""
        if self.on_write is not None:
            self.on_write(False)
        await asyncio.sleep(self.write_us / 1_000_000)
        if self.is_full:
            raise OSError(errno.ENOSPC, "no space left on device")
        self.entries.append(dict(entry))
        if self.on_write is not None:
            self.on_write(True)

    async def close(self) -> None:
        """Nothing to give back."""

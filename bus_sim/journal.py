"""A journal in memory that charges simulated time for each write, as an SD card does."""

import asyncio
from dataclasses import dataclass, field

from onboard.ports.journal import Entry

#: One durable write of a small record on an SD card, us. Ours: cards differ by a factor of ten.
WRITE_US = 4_000


@dataclass
class SimulatedJournal:
    """``ports.Journal`` in virtual time. ``entries`` outlives the controller, so a restarted one can replay it."""

    write_us: int = WRITE_US
    entries: list[Entry] = field(default_factory=list)

    def replay(self) -> list[Entry]:
        """All entries, oldest first."""
        return list(self.entries)

    async def append(self, entry: Entry) -> None:
        """Durable after ``write_us`` of virtual time."""
        await asyncio.sleep(self.write_us / 1_000_000)
        self.entries.append(dict(entry))

    async def close(self) -> None:
        """Nothing to give back."""

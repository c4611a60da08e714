"""What a controller needs of durable storage."""

from collections.abc import Mapping
from typing import Protocol

#: One journal entry: a flat record of plain values, ``record`` naming its type.
Entry = Mapping[str, str | int]


class Journal(Protocol):
    """An append-only journal. An entry counts once ``append`` has returned: it then survives a power cut."""

    def replay(self) -> list[Entry]:
        """All entries that were durably written, oldest first; a torn last entry is left out and counted."""

    async def append(self, entry: Entry) -> None:
        """Write durably. Raises ``OSError`` where that is impossible (disk full, medium gone)."""

    async def close(self) -> None:
        """Give the medium back."""

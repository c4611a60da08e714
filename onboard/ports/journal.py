"""What a controller needs of durable storage."""

from collections.abc import Callable, Iterable
from typing import Protocol

from onboard.core import journal_records
from onboard.core.journal_state import JournalCondition

#: One journal entry: a flat record of plain values.
Entry = journal_records.Entry
#: Entries in, fewer entries that mean the same out.
Compaction = Callable[[list[Entry]], list[Entry]]


class Journal(Protocol):
    """An append-only journal. An entry counts once ``append`` has returned: it then survives a power cut."""

    @property
    def condition(self) -> JournalCondition:
        """How it was found, known once ``replay`` was called."""

    @property
    def has_grown(self) -> bool:
        """Whether it is time to ``compact``."""

    def replay(self) -> list[Entry]:
        """The entries that can be believed, oldest first: all that were confirmed, where ``condition`` is reliable."""

    async def append(self, entry: Entry) -> None:
        """Write durably.

        Raises ``OSError`` where that is impossible (disk full, medium gone), or where the journal is not reliable.
        """

    async def compact(self, fewer: Compaction) -> None:
        """Replace all records by what ``fewer`` makes of them; at once or, after a power cut, not at all.

        Raises ``OSError`` as ``append`` does; the old records then still stand.
        """

    async def renew(self, entries: Iterable[Entry]) -> None:
        """Begin anew with ``entries``, in whatever condition it is; what was there is kept aside for a person."""

    async def close(self) -> None:
        """Give the medium back."""

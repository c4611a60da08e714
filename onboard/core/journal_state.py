"""What a machine knows of its own journal when it starts: whole, harmlessly cut, mended, or not to be relied on."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from onboard.contract.codes import Reason
from onboard.core.journal_records import Entry, RecordTypes, records_in
from onboard.core.records import BlockedRecord, BootRecord, ClearRecord, EpochRecord, ManualRecord

#: Why a machine holds whose rights nobody knows any more; only regeneration gives it any (docs/protocol.md).
RIGHTS_LOST = (Reason.JOURNAL_LOST, Reason.JOURNAL_SHORT, Reason.JOURNAL_FOREIGN)
#: Of a short journal these records still mean something: which lives there were, and what a person has decided. What
#: it says of rights, tasks and places may be long over: nobody knows how much is missing.
_STILL_COUNTS: RecordTypes = (BootRecord, EpochRecord, ManualRecord, BlockedRecord, ClearRecord)


class JournalState(Enum):
    """How a journal was found. Only ``SHORT`` and ``FOREIGN`` take the machine's rights away.

    An old but consistent copy of a journal reads INTACT, and one that is lost with its medium reads NEW: no medium can
    know that of itself, so the bus is asked (design, section 5).
    """

    NEW = "there is none: a first life, or all is lost"
    INTACT = "as it was sealed"
    TORN = "the last write was cut and never counted"
    MENDED = "its last records were damaged and are restored from their second copy"
    SHORT = "records that were sealed are missing"
    FOREIGN = "it is another machine's, or its records are not those that were sealed"


@dataclass(frozen=True, slots=True)
class JournalCondition:
    """``missing``: sealed records that cannot be read, None where not even their number is known; 0 if none.

    ``mended``: records that were restored. ``why``: one line for a person with file and remedy, empty where all is
    well.
    """

    state: JournalState = JournalState.INTACT
    missing: int | None = 0
    mended: int = 0
    why: str = ""

    @property
    def is_reliable(self) -> bool:
        """Whether what was read is all that was ever confirmed, as far as the medium can know."""
        return self.state not in (JournalState.SHORT, JournalState.FOREIGN)

    @property
    def is_foreign(self) -> bool:
        """Whether nothing may ever be written to it: it is somebody else's."""
        return self.state is JournalState.FOREIGN

    @property
    def line(self) -> str:
        """One line for a person: what is the matter, and the remedy; empty where the journal is reliable."""
        if self.is_reliable:
            return ""
        if self.is_foreign:
            return f"{self.why}; it holds: put the right board or its own journal in, or move that file away"
        return f"{self.why}; it holds and begins another beside it: onboard operate status tells what to do"


#: Nothing to tell.
INTACT = JournalCondition()
#: Found by others to be an old copy of itself.
OLD = JournalCondition(JournalState.SHORT, None, 0, "others know that this journal is old")


def reason_of(condition: JournalCondition) -> Reason:
    """What a machine says of a journal on the bus; NONE where it is reliable."""
    if condition.is_reliable:
        return Reason.NONE
    return Reason.JOURNAL_FOREIGN if condition.state is JournalState.FOREIGN else Reason.JOURNAL_SHORT


def still_counting(condition: JournalCondition, entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """What of a journal's entries a machine may go by: all where it is reliable, little where it is short."""
    if condition.is_reliable:
        return tuple(entries)
    return () if condition.is_foreign else tuple(one.entry for one in records_in(entries, *_STILL_COUNTS))

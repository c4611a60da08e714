"""What a robot has to do: nodes to visit in turn, task by task; kept in the journal (rows G11, G13)."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.messages import Reference
from onboard.core.effects import Record
from onboard.core.journal_records import Entry, records_in
from onboard.systems.graph.records import ErrandLostRecord, ErrandRecord

#: From here to there: an errand that was called for and not begun.
TRANSPORT_STOPS = 2


@dataclass(frozen=True, slots=True)
class Errand:
    """One task: ``stops`` are the nodes still to be visited; empty once it is done, or was taken back."""

    task: Reference
    stops: tuple[int, ...]
    is_cancelled: bool = False


def errand_record(errand: Errand) -> Record:
    """How far a task is; the newest entry counts."""
    return Record(ErrandRecord(errand.task, errand.stops, errand.is_cancelled))


def lost_record(task: Reference) -> Record:
    """The journal's word that the order is another's now."""
    return Record(ErrandLostRecord(task))


def errands(entries: Iterable[Entry]) -> dict[Reference, Errand]:
    """All tasks of the journal by name, in the order in which they were taken on; others are passed over."""
    found: dict[Reference, Errand] = {}
    for record in records_in(entries, ErrandRecord, ErrandLostRecord):
        if isinstance(record, ErrandRecord):
            found[record.task] = Errand(record.task, record.stops, record.cancelled)
        elif isinstance(record, ErrandLostRecord):
            found.pop(record.task, None)
    return found

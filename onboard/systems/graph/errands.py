"""What a robot has to do: nodes to visit in turn, task by task; kept in the journal (rows G11, G13)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from onboard.core.effects import Record
from onboard.core.messages import Reference

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
    entry: dict[str, str | int] = {"record": "errand", "origin": errand.task.origin, "number": errand.task.number}
    entry |= {"cancelled": 1} if errand.is_cancelled else {}
    return Record(entry | {"stops": " ".join(str(stop) for stop in errand.stops)})


def lost_record(task: Reference) -> Record:
    """It is another's now."""
    return Record({"record": "errand_lost", "origin": task.origin, "number": task.number})


def errands(entries: Iterable[Mapping[str, str | int]]) -> dict[Reference, Errand]:
    """All tasks of the journal by name, in the order in which they were taken on; others are passed over."""
    found: dict[Reference, Errand] = {}
    for entry in entries:
        if entry.get("record") == "errand":
            task = Reference(int(entry["origin"]), int(entry["number"]))
            stops = tuple(int(stop) for stop in str(entry["stops"]).split())
            found[task] = Errand(task, stops, "cancelled" in entry)
        elif entry.get("record") == "errand_lost":
            found.pop(Reference(int(entry["origin"]), int(entry["number"])), None)
    return found

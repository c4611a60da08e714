"""What a factory graph's machines write into their journals: robots their errands, the desk its orders.

Both are taken up in the order in which they first came.
"""

from dataclasses import dataclass, field

from onboard.contract.messages import Reference
from onboard.core.journal_records import (
    MOST_OVER,
    UNSAID,
    JournalRecord,
    Keep,
    RecordEnd,
    RecordTypes,
    Which,
    stored_as,
)
from onboard.work.order_life import OVER, OrderState

_TASK = ("task",)


@dataclass(frozen=True, slots=True)
class ErrandRecord(JournalRecord):
    """How far a task is: the nodes still to be visited, none once it is over; the newest record counts."""

    NAME = "errand"
    RULES = (
        Keep("errand", _TASK, Which.FIRST_AND_NEWEST),
        RecordEnd(("errand",), _TASK, ("stops", ((),)), MOST_OVER),
    )

    task: Reference = field(metadata=stored_as("origin", "number"))
    stops: tuple[int, ...]
    cancelled: bool = field(default=False, metadata=UNSAID)


@dataclass(frozen=True, slots=True)
class ErrandLostRecord(JournalRecord):
    """Another has the order now, and this robot forgets it."""

    NAME = "errand_lost"
    RULES = (RecordEnd(("errand",), _TASK),)

    task: Reference = field(metadata=stored_as("origin", "number"))


@dataclass(frozen=True, slots=True)
class VisitRecord(JournalRecord):
    """A desk's order; ``origin`` is who named it, 0 for the desk itself. ``robot``: whom it is for, or who has it."""

    NAME = "visit"
    RULES = (
        Keep("visit", ("origin", "number"), Which.FIRST_AND_NEWEST),
        RecordEnd(("visit",), ("origin", "number"), ("stage", OVER), MOST_OVER),
    )

    number: int
    robot: int
    named: bool
    stops: tuple[int, ...]
    stage: OrderState
    origin: int = 0


RECORDS: RecordTypes = (ErrandRecord, ErrandLostRecord, VisitRecord)

"""What a pick-up and delivery site's machines write into their journals: robots (memory.py), the desk (desk.py)."""

from dataclasses import dataclass

from onboard.core.journal_records import MOST_OVER, JournalRecord, Keep, RecordEnd, RecordTypes

_TASK = ("task",)


@dataclass(frozen=True, slots=True)
class PathRecord(JournalRecord):
    """A robot's path from ``step`` on, a cell for each step; for ``task``, as the wire numbers it."""

    NAME = "path"
    RULES = (Keep("path"),)

    step: int
    version: int
    task: int
    cells: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SetOutRecord(JournalRecord):
    """The step to which a robot is about to set out."""

    NAME = "step"
    RULES = (Keep("step"),)

    step: int


@dataclass(frozen=True, slots=True)
class TransportRecord(JournalRecord):
    """An order at the desk: two cells, and the step from which it is called for."""

    NAME = "transport"
    RULES = (Keep("transport", _TASK),)

    task: int
    pickup: int
    delivery: int
    release: int


@dataclass(frozen=True, slots=True)
class ServedRecord(JournalRecord):
    """A task was unloaded: for the desk, which does not know at which step; or is about to be, for its robot.

    A robot's newest counts; a desk knows of the last ``MOST_OVER`` that they are over.
    """

    NAME = "served"
    RULES = (RecordEnd(("transport",), _TASK), Keep("served", _TASK), RecordEnd(("served",), _TASK, most=MOST_OVER))

    task: int
    step: int | None = None


@dataclass(frozen=True, slots=True)
class RoundRecord(JournalRecord):
    """A round of the desk for ``step``, with so many tasks ``open``."""

    NAME = "round"
    RULES = (Keep("round"),)

    step: int
    bidding: bool
    open: int


@dataclass(frozen=True, slots=True)
class AwardsRecord(JournalRecord):
    """How a round of bids ended: robots whose task has changed, as words ``ROBOT:TASK``."""

    NAME = "awards"
    RULES = (Keep("awards"),)

    step: int
    changes: str


RECORDS: RecordTypes = (PathRecord, SetOutRecord, TransportRecord, ServedRecord, RoundRecord, AwardsRecord)

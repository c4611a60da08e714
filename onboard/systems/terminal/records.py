"""What a terminal's machines write into their journals: plans and boxes (memory.py), the desk's orders (missions.py).

Rows of numbers stand as text: numbers with commas between, rows with semicolons.
"""

from dataclasses import dataclass

from onboard.core.journal_records import JournalRecord, Keep, RecordEnd, RecordTypes, Which


@dataclass(frozen=True, slots=True)
class PlanRecord(JournalRecord):
    """A plan that begins at ``begin``, bus time in us; a new one ends the steps of the one before."""

    NAME = "plan"
    RULES = (Keep("plan"), RecordEnd(("step",)))

    version: int
    begin: int
    steps: str
    loads: str


@dataclass(frozen=True, slots=True)
class StepOverRecord(JournalRecord):
    """A step of the plan of this version was over at ``ended``, bus time in us."""

    NAME = "step"
    RULES = (Keep("step", which=Which.ALL),)

    version: int
    step: int
    ended: int


@dataclass(frozen=True, slots=True)
class BoxRecord(JournalRecord):
    """Where a box stands, as it was told under ``version`` of its right; its length as ``wheelbase``, mm."""

    NAME = "box"
    RULES = (Keep("box", ("box",)),)

    box: int
    station: int
    version: int
    wheelbase: int


@dataclass(frozen=True, slots=True)
class OrdersRecord(JournalRecord):
    """All of a desk that is not over; the newest counts. ``last``: the last task's number; ``done``: how many were."""

    NAME = "orders"
    RULES = (Keep("orders"),)

    missions: str
    tasks: str
    last: int
    done: int
    over: str = ""
    taken: str = ""


RECORDS: RecordTypes = (PlanRecord, StepOverRecord, BoxRecord, OrdersRecord)

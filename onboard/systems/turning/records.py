"""What a turning shop's machines write into their journals: lathes their jobs (machine.py), the desk its orders."""

from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.messages import Reference
from onboard.core.journal_records import MOST_OVER, JournalRecord, Keep, RecordEnd, RecordTypes, stored_as
from onboard.systems.turning.lathe import TurningJob
from onboard.work.order_records import OrderRecord, OrderStateRecord

_TASK = ("task",)


class BatchStage(Enum):
    """How far an order is, each a point from which a lathe that starts again can go on."""

    WON = "not begun"
    SETTING = "program loaded; being set up, or about to be"
    MAKING = "set up; parts are made"


@dataclass(frozen=True, slots=True)
class JobRecord(JournalRecord):
    """A job that was won; the bar in whole mm, the allowance at its face in um."""

    NAME = "job"
    RULES = (Keep("job", _TASK),)

    task: Reference = field(metadata=stored_as("origin", "number"))
    drawing: int
    material: int
    bar_mm: int
    batch: int
    face_um: int

    @property
    def job(self) -> TurningJob:
        """As a lathe reckons with it."""
        return TurningJob(self.drawing, self.material, self.bar_mm, self.batch, self.face_um / 1000)


@dataclass(frozen=True, slots=True)
class JobStageRecord(JournalRecord):
    """How far the lathe is with a job."""

    NAME = "job_stage"
    RULES = (Keep("job_stage", _TASK),)

    task: Reference = field(metadata=stored_as("origin", "number"))
    stage: BatchStage


@dataclass(frozen=True, slots=True)
class JobLostRecord(JournalRecord):
    """Another has the job now, and this lathe forgets it."""

    NAME = "job_lost"
    RULES = (RecordEnd(("job", "job_stage"), _TASK),)

    task: Reference = field(metadata=stored_as("origin", "number"))


@dataclass(frozen=True, slots=True)
class JobOverRecord(JournalRecord):
    """It is over: that is kept as long as ``MOST_OVER`` others, the job itself is not."""

    NAME = "job_over"
    RULES = (
        RecordEnd(("job", "job_stage"), _TASK),
        Keep("job_over", _TASK),
        RecordEnd(("job_over",), _TASK, most=MOST_OVER),
    )

    task: Reference = field(metadata=stored_as("origin", "number"))


@dataclass(frozen=True, slots=True)
class JobOrderRecord(OrderRecord):
    """Parts are wanted; units as in ``JobRecord``."""

    drawing: int
    material: int
    bar_mm: int
    batch: int
    face_um: int

    @property
    def job(self) -> TurningJob:
        """As a lathe reckons with it."""
        return TurningJob(self.drawing, self.material, self.bar_mm, self.batch, self.face_um / 1000)


@dataclass(frozen=True, slots=True)
class JobOrderStateRecord(OrderStateRecord):
    """With what the winner asks for it, in cents."""

    total_ct: int


RECORDS: RecordTypes = (
    JobRecord,
    JobStageRecord,
    JobLostRecord,
    JobOverRecord,
    JobOrderRecord,
    JobOrderStateRecord,
)

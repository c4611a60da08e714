"""What a robot writes down before it says or does it, and what it knows from there when it starts again."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.mapd import StepState
from onboard.contract.mapd_device import CartState
from onboard.core.effects import Record
from onboard.core.journal_records import Entry, records_in
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.paths import Path
from onboard.systems.mapd.records import PathRecord, ServedRecord, SetOutRecord


@dataclass(frozen=True)
class Past:
    """``path`` is the last one planned, under ``version``, for ``task``; ``step`` the last one to which it set out.

    Without a path there was no turn yet. ``served`` are the last task that was to be unloaded, and the step before.
    """

    path: Path | None = None
    version: int = 0
    task: int = NO_TASK
    step: int = 0
    served: tuple[int, int] = (NO_TASK, -1)

    def come_to(self, step: int, path: Path, body: CartState) -> StepState:
        """The word of having come to ``step``, from which it set out since; that it served there was told before."""
        is_loaded = body.task != NO_TASK or self.served == (self.task, step)
        return StepState(body.sender, step, path.at(step), self.task, is_loaded, False)


def path_record(path: Path, version: int, task: int) -> Record:
    """A path, before it is told."""
    return Record(PathRecord(path.start, version, task, path.cells))


def step_record(step: int) -> Record:
    """The step to which a robot is about to set out."""
    return Record(SetOutRecord(step))


def served_record(task: int, step: int) -> Record:
    """A task that is about to be unloaded, at ``step`` or on the way from it."""
    return Record(ServedRecord(task, step))


def read_past(entries: Iterable[Entry]) -> Past:
    """The journal's last words, oldest entry first; entries of other record types are passed over."""
    path, version, task, step, served = None, 0, NO_TASK, 0, (NO_TASK, -1)
    for record in records_in(entries, PathRecord, SetOutRecord, ServedRecord):
        match record:
            case PathRecord():
                path, version, task = Path(record.step, record.cells), record.version, record.task
            case SetOutRecord():
                step = record.step
            case ServedRecord(task=one, step=int(at)):
                served = one, at
    return Past(path, version, task, step, served)

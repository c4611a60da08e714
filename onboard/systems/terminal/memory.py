"""What a machine of a terminal writes into its journal, and what it reads there after a restart."""

from collections.abc import Iterable

from onboard.contract.messages import CarAt, Reference
from onboard.contract.terminal import Action
from onboard.core.journal_records import Entry, records_in
from onboard.systems.terminal.plan import ActionPlan, ActionStep, EntityStay, Load
from onboard.systems.terminal.records import BoxRecord, PlanRecord, StepOverRecord


def plan_record(plan: ActionPlan) -> PlanRecord:
    """A plan; steps and loads as numbers, one after the other."""
    steps = ";".join(",".join(str(int(n)) for n in (*step[:4], *step.after)) for step in plan.steps)
    loads = ";".join(
        ",".join(str(n) for n in (load.box, *load.task, load.pick, load.put, load.before)) for load in plan.loads
    )
    return PlanRecord(plan.version, plan.begin, steps, loads)


def box_record(statement: CarAt) -> BoxRecord:
    """Where I know a box to stand: nobody else may know it when the power comes back."""
    return BoxRecord(statement.car.number, statement.station, statement.version, statement.wheelbase_mm)


def read_boxes(node: int, desk: int, entries: Iterable[Entry]) -> list[CarAt]:
    """What I said of boxes that I had put down, or have in my books, in the order in which they came to stand there."""
    return [
        CarAt(node, Reference(desk, one.box), one.station, one.version, one.wheelbase)
        for one in records_in(entries, BoxRecord)
    ]


def read_plan(owner: int, entries: Iterable[Entry]) -> tuple[ActionPlan | None, list[tuple[int, int]]]:
    """The newest plan, None where there was never one, and its steps that are over with their times."""
    plan: ActionPlan | None = None
    over: list[tuple[int, int]] = []
    for record in records_in(entries, PlanRecord, StepOverRecord):
        if isinstance(record, PlanRecord):
            plan, over = _plan(owner, record), []
        elif isinstance(record, StepOverRecord) and plan is not None and record.version == plan.version:
            over.append((record.step, record.ended))
    return plan, over


def _rows(text: str) -> list[list[int]]:
    return [[int(one) for one in row.split(",")] for row in text.split(";") if row]


def _plan(owner: int, record: PlanRecord) -> ActionPlan:
    steps = tuple(
        ActionStep(Action(row[0]), row[1], row[2], row[3], EntityStay(row[4], row[5])) for row in _rows(record.steps)
    )
    loads = tuple(Load(row[0], Reference(row[1], row[2]), *row[3:6]) for row in _rows(record.loads))
    return ActionPlan(owner, record.version, record.begin, steps, loads)

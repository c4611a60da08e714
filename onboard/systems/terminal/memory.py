"""What a machine of a terminal writes into its journal, and what it reads there after a restart."""

from collections.abc import Iterable, Mapping

from onboard.core.messages import CarAt, Reference
from onboard.systems.terminal.messages import Action
from onboard.systems.terminal.plan import Load, Plan, Step, VisitKey

Entry = Mapping[str, str | int]


def plan_record(plan: Plan) -> dict[str, str | int]:
    """A plan; steps and loads as numbers, one after the other."""
    steps = ";".join(",".join(str(int(n)) for n in (*step[:4], *step.after)) for step in plan.steps)
    loads = ";".join(
        ",".join(str(n) for n in (load.box, *load.task, load.pick, load.put, load.before)) for load in plan.loads
    )
    return {"record": "plan", "version": plan.version, "begin": plan.begin, "steps": steps, "loads": loads}


def step_record(version: int, step: int, ended_us: int) -> dict[str, str | int]:
    """A step is over."""
    return {"record": "step", "version": version, "step": step, "ended": ended_us}


def box_record(statement: CarAt) -> dict[str, str | int]:
    """Where I know a box to stand: nobody else may know it when the power comes back."""
    return {
        "record": "box",
        "box": statement.car.number,
        "station": statement.station,
        "version": statement.version,
        "wheelbase": statement.wheelbase_mm,
    }


def read_boxes(node: int, desk: int, entries: Iterable[Entry]) -> list[CarAt]:
    """What I said of boxes that I had put down, or have in my books, in the order in which they came to stand there."""
    return [
        CarAt(
            node,
            Reference(desk, int(entry["box"])),
            int(entry["station"]),
            int(entry["version"]),
            int(entry["wheelbase"]),
        )
        for entry in entries
        if entry.get("record") == "box"
    ]


def read_plan(owner: int, entries: Iterable[Entry]) -> tuple[Plan | None, list[tuple[int, int]]]:
    """The newest plan, None where there was never one, and its steps that are over with their times."""
    plan: Plan | None = None
    over: list[tuple[int, int]] = []
    for entry in entries:
        if entry.get("record") == "plan":
            plan, over = _plan(owner, entry), []
        elif entry.get("record") == "step" and plan is not None and entry["version"] == plan.version:
            over.append((int(entry["step"]), int(entry["ended"])))
    return plan, over


def _rows(text: str | int) -> list[list[int]]:
    return [[int(one) for one in row.split(",")] for row in str(text).split(";") if row]


def _plan(owner: int, entry: Entry) -> Plan:
    steps = tuple(
        Step(Action(row[0]), row[1], row[2], row[3], VisitKey(row[4], row[5])) for row in _rows(entry["steps"])
    )
    loads = tuple(Load(row[0], Reference(row[1], row[2]), *row[3:6]) for row in _rows(entry["loads"]))
    return Plan(owner, int(entry["version"]), int(entry["begin"]), steps, loads)

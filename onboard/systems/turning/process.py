"""The task-generation function of a lathe, in the five stages that the paper names (rows P24 to P26).

Task, characteristics and the state of the tools go in; the bid's five terms, the trajectories and the ISO program come
out. Nothing here depends on other machines: the first of the paper's two kinds of such functions (row P21).
"""

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

from onboard.systems.turning.clamping import Clamping, choose_clamping
from onboard.systems.turning.conditions import Conditions, choose_conditions, choose_tools, operations
from onboard.systems.turning.cost import Bill, ToolEdgeUse, bill
from onboard.systems.turning.drawing import Drawing
from onboard.systems.turning.iso import program
from onboard.systems.turning.lathe import Lathe, LatheState, Material, Tool, TurningJob
from onboard.systems.turning.trajectories import Trajectory, cutting_min, rapid_min, trajectories


class Wear(NamedTuple):
    """One tool over a batch: edges changed, minutes of life thrown away with them, minutes left of the last one."""

    changes: int
    wasted_min: float
    left_min: float


def wear_of(left_min: float, life_min: float, cut_min: float, batch: int) -> Wear | None:
    """An edge is changed before a part that it would not last for; None where no edge lasts for one part."""
    if cut_min > life_min:
        return None
    changes, wasted_min = 0, 0.0
    for _ in range(batch):
        if left_min < cut_min:
            changes, wasted_min, left_min = changes + 1, wasted_min + left_min, life_min
        left_min -= cut_min
    return Wear(changes, wasted_min, left_min)


@dataclass(frozen=True, slots=True)
class Process:
    """How a lathe would make one part, stage by stage, and what it costs. Times in minutes for one part.

    ``wear_min`` is what each tool cuts; ``wear`` what that means for its edges over the whole batch.
    """

    clamping: Clamping
    tools: tuple[Tool, ...]
    conditions: tuple[Conditions, ...]
    paths: tuple[Trajectory, ...]
    program: str
    machining_min: float
    wear_min: dict[int, float]
    wear: dict[int, "Wear"]
    bill: Bill


def generate(job: TurningJob, drawing: Drawing, material: Material, lathe: Lathe, state: LatheState) -> Process | None:
    """The five stages, one after the other; None where the lathe cannot hold the bar or lacks a tool."""
    clamping = choose_clamping(job, drawing, lathe)
    if clamping is None:
        return None
    works = operations(job, drawing)
    tools = choose_tools(works, lathe, state)
    if tools is None:
        return None
    conditions = choose_conditions(works, tools, material, drawing, lathe)
    paths = trajectories(job, drawing, conditions)
    wear_min: dict[int, float] = {}
    for path in paths:
        number = path.conditions.tool.number
        wear_min[number] = wear_min.get(number, 0.0) + cutting_min(path)
    used = tuple(dict.fromkeys(tools))
    wear = _wear(used, wear_min, job, state)
    if wear is None:
        return None
    machining_min = sum(cutting_min(path) + rapid_min(path, lathe) + lathe.tool_change_min for path in paths)
    return Process(
        clamping,
        tools,
        conditions,
        paths,
        program(drawing, paths),
        machining_min,
        wear_min,
        wear,
        bill(
            lathe.hourly_eur,
            machining_min,
            tuple(ToolEdgeUse(tool.edge_eur, wear_min[tool.number], tool.life_min) for tool in used),
            _setup_min(job, clamping, lathe, state) + lathe.edge_change_min * sum(one.changes for one in wear.values()),
            job.batch,
            bar_eur(job, clamping, material),
            lathe.load_min + lathe.unload_min,
            sum(tool.edge_eur * wear[tool.number].wasted_min / tool.life_min for tool in used),
        ),
    )


def _wear(
    used: tuple[Tool, ...], wear_min: dict[int, float], job: TurningJob, state: LatheState
) -> dict[int, Wear] | None:
    found = {}
    for tool in used:
        wear = wear_of(state.left_min(tool), tool.life_min, wear_min[tool.number], job.batch)
        if wear is None:
            return None
        found[tool.number] = wear
    return found


def bar_eur(job: TurningJob, clamping: Clamping, material: Material) -> float:
    """The raw material of one part: the bar between the cuts, the part in the jaws included."""
    volume_dm3 = pi / 4 * (job.bar_mm / 100) ** 2 * clamping.bar_length_mm / 100
    return volume_dm3 * material.density_kg_dm3 * material.eur_kg


def _setup_min(job: TurningJob, clamping: Clamping, lathe: Lathe, state: LatheState) -> float:
    """Nothing where the lathe is set up for this part in this chuck already."""
    return 0.0 if state.set_up_for == (job.drawing, clamping.chuck.name) else lathe.setup_min

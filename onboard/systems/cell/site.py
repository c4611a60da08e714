"""What the machines of a cell know beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from onboard.contract.codes import KindCode
from onboard.core.site import MotionNeeds, Site
from onboard.systems.cell.contracts import Arm
from onboard.systems.cell.geometry import Area, Point
from onboard.work.timing import DeviceTiming

__all__ = ["Area", "Arm", "Cell", "GoalDemand", "Point"]

#: Farthest from the origin that a coordinate may be, mm: PartAt has 19 bits for it.
MAX_COORDINATE_MM = 250_000


@dataclass(frozen=True, slots=True)
class GoalDemand:
    """A goal that the site's own demand brings: after ``at_ms``, carry a part, within ``within_ms`` (0: no limit)."""

    at_ms: int
    start: Point
    end: Point
    within_ms: int = 0


@dataclass(frozen=True, kw_only=True)
class Cell(Site):
    """A cell: its robots' areas and the known obstacles (row C01). ``goals`` are what a run of it asks for."""

    system: ClassVar[str] = "cell"
    called: ClassVar[str] = "manufacturing cell"
    demand: ClassVar[frozenset[str]] = frozenset({"goals"})
    #: What more machines add to while the cell works: a right of a cell is to a part, and begins with who named it.
    GROWS: ClassVar[frozenset[str]] = frozenset({"machines", "arms"})
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {"ArmOrder": MotionNeeds.RIGHT, "GripOrder": MotionNeeds.RIGHT}

    timing: DeviceTiming
    arms: dict[int, Arm]
    obstacles: tuple[Area, ...] = ()
    goals: tuple[GoalDemand, ...] = ()

    @cached_property
    def least_unit_cost(self) -> float:
        """Nobody carries for less than this per metre."""
        return min((arm.unit_cost for arm in self.arms.values()), default=0.0)

    @cached_property
    def desks(self) -> tuple[int, ...]:
        """Node-IDs of the goal managers, lowest first."""
        return tuple(node for node, one in sorted(self.machines.items()) if one.kind is KindCode.DESK)

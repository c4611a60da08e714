"""What the machines of a turning cell know beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from onboard.contract.codes import KindCode
from onboard.core.site import MotionNeeds, Site
from onboard.systems.turning.drawing import At, ContourElement, Drawing, element_fault
from onboard.systems.turning.lathe import Chuck, Lathe, LatheOperation, Material, Tool, TurningJob

__all__ = [
    "At",
    "BatchDemand",
    "Chuck",
    "ContourElement",
    "Drawing",
    "Lathe",
    "LatheOperation",
    "Material",
    "Tool",
    "Turning",
    "TurningJob",
    "element_fault",
]


@dataclass(frozen=True, slots=True)
class BatchDemand:
    """An order that the site's own demand brings, ``at_ms`` after its begin."""

    at_ms: int
    job: TurningJob


@dataclass(frozen=True, kw_only=True)
class Turning(Site):
    """A turning cell: its lathes, and the drawings and materials that orders name. A run asks for ``orders``."""

    system: ClassVar[str] = "turning"
    called: ClassVar[str] = "turning cell"
    demand: ClassVar[frozenset[str]] = frozenset({"orders"})
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {"LatheOrder": MotionNeeds.ALONE}

    lathes: dict[int, Lathe]
    drawings: dict[int, Drawing]
    materials: dict[int, Material]
    orders: tuple[BatchDemand, ...] = ()

    @cached_property
    def desks(self) -> tuple[int, ...]:
        """Node-IDs of the desks, lowest first."""
        return tuple(node for node, one in sorted(self.machines.items()) if one.kind is KindCode.DESK)

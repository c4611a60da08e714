"""What an NC lathe is and has: characteristics, tools with their wear, and materials (row P24)."""

from dataclasses import dataclass, field
from enum import Enum


class LatheOperation(Enum):
    """What a tool is made for; also the operations of a part, in their order."""

    FACE = "facing"
    ROUGH = "roughing"
    FINISH = "finishing"


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool in the turret. ``life_min`` of cutting at ``speed_m_min`` wears one edge out (Taylor 1907, one point).

    ``depth_mm`` is the deepest cut, ``feed_mm`` the feed per revolution it stands, ``nose_mm`` the nose radius,
    ``edge_eur`` the price of one edge; all above 0.
    """

    number: int
    works: tuple[LatheOperation, ...]
    speed_m_min: float
    depth_mm: float
    feed_mm: float
    nose_mm: float
    edge_eur: float
    life_min: float


@dataclass(frozen=True, slots=True)
class Material:
    """A bar's material: ``cutting_force_n_mm2`` (Kienzle's k_c, taken as constant), price per kg, density.

    ``speed_factor`` scales the tools' cutting speeds, 1 for the steel that they are given for.
    """

    number: int
    name: str
    cutting_force_n_mm2: float
    eur_kg: float
    density_kg_dm3: float
    speed_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Chuck:
    """Jaws that grip bars from ``min_mm`` to ``max_mm`` in diameter, ``grip_mm`` deep."""

    name: str
    min_mm: float
    max_mm: float
    grip_mm: float


@dataclass(frozen=True, slots=True)
class Lathe:
    """Characteristics of a lathe. Times in minutes, money in EUR an hour, power in kW at the spindle.

    ``reach_mm`` is the longest part that sticks out of the chuck; ``stiffness`` how often its diameter it may stick out
    without a tailstock.
    """

    node_id: int
    name: str
    hourly_eur: float
    power_kw: float
    spindle_max_rpm: float
    reach_mm: float
    chucks: tuple[Chuck, ...]
    tools: tuple[Tool, ...]
    has_tailstock: bool = False
    stiffness: float = 3.0
    rapid_mm_min: float = 8000.0
    setup_min: float = 15.0
    load_min: float = 0.25
    unload_min: float = 0.25
    tool_change_min: float = 0.05
    edge_change_min: float = 2.0


@dataclass
class LatheState:
    """What changes: minutes that each tool's edge has cut, and what the lathe is set up for (drawing, chuck)."""

    used_min: dict[int, float] = field(default_factory=dict)
    set_up_for: tuple[int, str] | None = None

    def left_min(self, tool: Tool) -> float:
        """Minutes that an edge will still cut."""
        return max(0.0, tool.life_min - self.used_min.get(tool.number, 0.0))


@dataclass(frozen=True, slots=True)
class TurningJob:
    """A turning task: a drawing's number, the bar (material, diameter, allowance at the face) and how many to make."""

    drawing: int
    material: int
    bar_mm: float
    batch: int = 1
    face_mm: float = 1.0

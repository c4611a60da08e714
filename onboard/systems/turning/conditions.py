"""Stages 2 and 3 (row P25): the tool of each operation, and how it cuts."""

from dataclasses import dataclass
from math import pi, sqrt

from onboard.systems.turning.drawing import Drawing
from onboard.systems.turning.lathe import Lathe, LatheOperation, LatheState, Material, Tool, TurningJob

#: Share of the motor's power that reaches the cut. Usual for geared lathes.
EFFICIENCY = 0.8
#: What roughing leaves for finishing, mm on the radius and on faces: an ordinary finishing allowance, from no standard.
ALLOWANCE_MM = 0.4


@dataclass(frozen=True, slots=True)
class Conditions:
    """How one operation is cut: surface speed in m/min, feed in mm a revolution, depth on the radius in mm."""

    work: LatheOperation
    tool: Tool
    speed_m_min: float
    feed_mm: float
    depth_mm: float
    spindle_max_rpm: float

    def rpm(self, diameter_mm: float) -> float:
        """Spindle speed at constant surface speed, bounded by the spindle."""
        if diameter_mm <= 0:
            return self.spindle_max_rpm
        return min(self.spindle_max_rpm, 1000 * self.speed_m_min / (pi * diameter_mm))


def operations(job: TurningJob, drawing: Drawing) -> tuple[LatheOperation, ...]:
    """What a part needs: facing where the bar is longer, roughing where it is thicker than finishing takes off."""
    depth_mm = job.bar_mm / 2 - drawing.front_um / 1000
    face = (LatheOperation.FACE,) if job.face_mm > 0 else ()
    rough = (LatheOperation.ROUGH,) if depth_mm > ALLOWANCE_MM else ()
    return (*face, *rough, LatheOperation.FINISH)


def choose_tools(works: tuple[LatheOperation, ...], lathe: Lathe, state: LatheState) -> tuple[Tool, ...] | None:
    """For each operation the suited tool with the cheapest minute of cutting; of equals the one with more life left.

    None where the turret has no tool for an operation.
    """
    chosen = []
    for work in works:
        suited = [tool for tool in lathe.tools if work in tool.works]
        if not suited:
            return None
        chosen.append(min(suited, key=lambda tool: (tool.edge_eur / tool.life_min, -state.left_min(tool), tool.number)))
    return tuple(chosen)


def choose_conditions(
    works: tuple[LatheOperation, ...], tools: tuple[Tool, ...], material: Material, drawing: Drawing, lathe: Lathe
) -> tuple[Conditions, ...]:
    """Speed by tool and material, feed by tool or by the roughness asked for, depth by tool and spindle power."""
    return tuple(_conditions(work, tool, material, drawing, lathe) for work, tool in zip(works, tools, strict=True))


def _conditions(work: LatheOperation, tool: Tool, material: Material, drawing: Drawing, lathe: Lathe) -> Conditions:
    speed_m_min = tool.speed_m_min * material.speed_factor
    feed_mm = tool.feed_mm
    if work is LatheOperation.FINISH:
        feed_mm = min(feed_mm, finish_feed_mm(drawing.roughness_um, tool.nose_mm))
    depth_mm = min(tool.depth_mm, power_depth_mm(lathe.power_kw, material.cutting_force_n_mm2, feed_mm, speed_m_min))
    return Conditions(work, tool, speed_m_min, feed_mm, depth_mm, lathe.spindle_max_rpm)


def finish_feed_mm(roughness_um: float, nose_mm: float) -> float:
    """Feed that a nose radius turns to a mean roughness Ra: Ra = f^2 / (32 r), the usual estimate."""
    return sqrt(32 * nose_mm * roughness_um / 1000)


def power_depth_mm(power_kw: float, cutting_force_n_mm2: float, feed_mm: float, speed_m_min: float) -> float:
    """Deepest cut for a spindle power: P = k_c a f v / 60000, in kW with N/mm^2, mm, mm and m/min."""
    return 60_000 * power_kw * EFFICIENCY / (cutting_force_n_mm2 * feed_mm * speed_m_min)

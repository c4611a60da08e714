"""Stage 1 (row P25): how the bar is clamped."""

from dataclasses import dataclass

from onboard.systems.turning.drawing import Drawing
from onboard.systems.turning.lathe import Chuck, Lathe, TurningJob

#: What stays between the jaws and the last cut, mm: enough that a tool holder passes.
JAW_GAP_MM = 5.0


@dataclass(frozen=True, slots=True)
class Clamping:
    """The chuck, whether the tailstock supports the part, and the length of bar used up, mm."""

    chuck: Chuck
    tailstock: bool
    bar_length_mm: float


def choose_clamping(job: TurningJob, drawing: Drawing, lathe: Lathe) -> Clamping | None:
    """The first chuck that grips the bar; the tailstock where the part sticks out too far for its diameter.

    None where the lathe cannot hold the part, or the bar is too thin for the drawing.
    """
    if job.bar_mm < drawing.diameter_mm or drawing.length_mm + job.face_mm + JAW_GAP_MM > lathe.reach_mm:
        return None
    chuck = next((one for one in lathe.chucks if one.min_mm <= job.bar_mm <= one.max_mm), None)
    if chuck is None:
        return None
    overhang_mm = drawing.length_mm + job.face_mm + JAW_GAP_MM
    needs_tailstock = overhang_mm > lathe.stiffness * job.bar_mm
    if needs_tailstock and not lathe.has_tailstock:
        return None
    return Clamping(chuck, needs_tailstock, overhang_mm + chuck.grip_mm)

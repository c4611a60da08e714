"""Stage 5 (row P25): the program in ISO 6983-1 words for a lathe with its turret behind the axis.

X is a diameter, Z 0 at the finished face, I and K from the start of an arc to its centre (I a radius), feeds in mm a
revolution at constant surface speed, tool-nose compensation by the control (G42) along the finished contour.
"""

from onboard.systems.turning.drawing import Drawing
from onboard.systems.turning.lathe import LatheOperation
from onboard.systems.turning.trajectories import Cut, Trajectory, Xz


def program(drawing: Drawing, paths: tuple[Trajectory, ...]) -> str:
    """The whole program, one block a line, blocks numbered by tens."""
    blocks = ["G21 G18 G90 G40"]
    for path in paths:
        blocks += _operation(path)
    blocks += ["G97 M5", "M30"]
    numbered = [f"N{10 * number} {block}" for number, block in enumerate(blocks, 1)]
    return "\n".join(["%", f"O{drawing.number:04d}", *numbered, "%"]) + "\n"


def _operation(path: Trajectory) -> list[str]:
    how, at = path.conditions, path.start
    tool = f"T{how.tool.number:02d}{how.tool.number:02d}"
    blocks = [
        f"({how.work.value})",
        tool,
        f"G92 S{how.spindle_max_rpm:.0f}",
        f"G95 G96 S{how.speed_m_min:.0f} M3",
        f"G0 X{_mm(2 * at.x_mm)} Z{_mm(at.z_mm)}",
    ]
    if how.work is LatheOperation.FINISH:
        blocks.append("G42")
    for cut in path.cuts:
        blocks.append(_block(at, cut, how.feed_mm))
        at = cut.end
    if how.work is LatheOperation.FINISH:
        blocks.append("G40")
    return blocks


def _block(start: Xz, cut: Cut, feed_mm: float) -> str:
    where = f"X{_mm(2 * cut.end.x_mm)} Z{_mm(cut.end.z_mm)}"
    if cut.rapid:
        return f"G0 {where}"
    if cut.centre is None:
        return f"G1 {where} F{feed_mm:.3f}"
    # Seen with Z to the right and X up, a round end is counter-clockwise on the way to the chuck, a fillet clockwise.
    word = "G3" if cut.convex else "G2"
    centre = f"I{_mm(cut.centre.x_mm - start.x_mm)} K{_mm(cut.centre.z_mm - start.z_mm)}"
    return f"{word} {where} {centre} F{feed_mm:.3f}"


def _mm(value: float) -> str:
    """Three decimals, and never a negative zero."""
    text = f"{value:.3f}"
    return "0.000" if text == "-0.000" else text

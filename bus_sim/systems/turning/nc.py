"""A numerical control's reading of an ISO 6983 program, and what the program does: time, wear, contour.

It shares no code with what wrote the program: words are read here, and arcs are followed by I and K.
"""

import re
from dataclasses import dataclass, field
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin

_WORD = re.compile(r"([A-Z])([-+]?[0-9]*\.?[0-9]+)")
#: Pieces into which a cut is divided.
PIECES = 24
MOVES = {0: "rapid", 1: "line", 2: "clockwise", 3: "counter-clockwise"}


class ProgramError(ValueError):
    """A program that this control cannot run: the block and what is wrong."""


@dataclass
class ProgramRun:
    """What one run of a program does. Radii and lengths in mm, minutes under feed by tool, and in rapid moves."""

    cuts: list[list[tuple[float, float]]] = field(default_factory=list)
    rapids: list[list[tuple[float, float]]] = field(default_factory=list)
    cut_min: dict[int, float] = field(default_factory=dict)
    rapid_mm: float = 0.0
    tool_changes: int = 0


@dataclass
class _Modal:
    """What stays in force from block to block."""

    move: int = 0
    x_mm: float = 0.0
    z_mm: float = 0.0
    feed_mm: float = 0.0
    speed_m_min: float = 0.0
    rpm_max: float = 0.0
    tool: int = 0


def run_program(text: str) -> ProgramRun:
    """Run a program once. Raises ``ProgramError`` where it is none."""
    run, modal, ended = ProgramRun(), _Modal(), False
    for line in text.splitlines():
        block = re.sub(r"\([^)]*\)", "", line).strip()
        if not block or block == "%" or block.startswith("O"):
            continue
        words = _WORD.findall(block)
        if "".join(letter + number for letter, number in words) != block.replace(" ", ""):
            raise ProgramError(f"{line}: cannot be read")
        ended = _block(words, modal, run, line) or ended
    if not ended:
        raise ProgramError("no M30 at the end")
    return run


def _block(words: list[tuple[str, str]], modal: _Modal, run: ProgramRun, line: str) -> bool:
    """One block; True for the end of the program."""
    codes = [int(float(number)) for letter, number in words if letter == "G"]
    values = {letter: float(number) for letter, number in words if letter != "G"}
    if "T" in values:
        run.tool_changes += 1
        modal.tool = int(values["T"]) // 100
    modal.feed_mm = values.get("F", modal.feed_mm)
    if "S" in values:
        if 92 in codes:
            modal.rpm_max = values["S"]
        else:
            modal.speed_m_min = values["S"]
    modal.move = next((code for code in codes if code in MOVES), modal.move)
    if "X" in values or "Z" in values:
        _move(values, modal, run, line)
    return values.get("M") == 30


def _move(values: dict[str, float], modal: _Modal, run: ProgramRun, line: str) -> None:
    start = (modal.x_mm, modal.z_mm)
    end = (values.get("X", 2 * modal.x_mm) / 2, values.get("Z", modal.z_mm))
    modal.x_mm, modal.z_mm = end
    if modal.move == 0:
        run.rapids.append(_line(start, end))
        run.rapid_mm += hypot(end[0] - start[0], end[1] - start[1])
        return
    if not (modal.feed_mm > 0 and modal.speed_m_min > 0 and modal.rpm_max > 0 and modal.tool):
        raise ProgramError(f"{line}: a cut without tool, feed or spindle")
    path = _line(start, end) if modal.move == 1 else _arc(start, end, values, modal.move == 2, line)
    run.cuts.append(path)
    minutes = 0.0
    for one, other in pairwise(path):
        diameter_mm = one[0] + other[0]
        rpm = min(modal.rpm_max, 1000 * modal.speed_m_min / (pi * diameter_mm)) if diameter_mm > 0 else modal.rpm_max
        minutes += hypot(other[0] - one[0], other[1] - one[1]) / (modal.feed_mm * rpm)
    run.cut_min[modal.tool] = run.cut_min.get(modal.tool, 0.0) + minutes


def _line(start: tuple[float, float], end: tuple[float, float]) -> list[tuple[float, float]]:
    steps = [i / PIECES for i in range(PIECES + 1)]
    return [(start[0] + (end[0] - start[0]) * s, start[1] + (end[1] - start[1]) * s) for s in steps]


def _arc(
    start: tuple[float, float], end: tuple[float, float], values: dict[str, float], clockwise: bool, line: str
) -> list[tuple[float, float]]:
    centre = (start[0] + values.get("I", 0.0), start[1] + values.get("K", 0.0))
    radius = hypot(start[0] - centre[0], start[1] - centre[1])
    if abs(radius - hypot(end[0] - centre[0], end[1] - centre[1])) > 0.005:
        raise ProgramError(f"{line}: the arc's ends are not equally far from its centre")
    begin = atan2(start[0] - centre[0], start[1] - centre[1])
    turn = (atan2(end[0] - centre[0], end[1] - centre[1]) - begin) % (2 * pi)
    if clockwise:
        turn -= 2 * pi
    angles = [begin + turn * i / PIECES for i in range(PIECES + 1)]
    return [(centre[0] + radius * sin(a), centre[1] + radius * cos(a)) for a in angles]


def contour_error_mm(run: ProgramRun, contour: list[tuple[float, float]]) -> float:
    """How far the made part is from the drawing, ``contour`` as (radius, z) points from the face to the chuck.

    The larger of: the farthest that a point of the drawing is from any cut, and the deepest that any move goes into
    the part.
    """
    missed = max(min(_distance(point, path) for path in run.cuts) for point in contour)
    deepest = 0.0
    for path in (*run.cuts, *run.rapids):
        for radius, z in path:
            at = _radius_at(contour, z)
            if at is not None and radius < at - 1e-6:
                deepest = max(deepest, min(at - radius, _distance((radius, z), contour)))
    return max(missed, deepest)


def _radius_at(contour: list[tuple[float, float]], z: float) -> float | None:
    """Radius of the part at a length, the smaller one at a face; None before the face and behind the end."""
    if z >= contour[0][1] - 1e-9 or z < contour[-1][1]:
        return None
    for (r0, z0), (r1, z1) in pairwise(contour):
        if z1 <= z <= z0 and z0 > z1:
            return r0 + (r1 - r0) * (z0 - z) / (z0 - z1)
    return None


def _distance(point: tuple[float, float], path: list[tuple[float, float]]) -> float:
    return min(_to_piece(point, one, other) for one, other in pairwise(path))


def _to_piece(point: tuple[float, float], one: tuple[float, float], other: tuple[float, float]) -> float:
    dr, dz = other[0] - one[0], other[1] - one[1]
    length = dr * dr + dz * dz
    along = 0.0 if not length else ((point[0] - one[0]) * dr + (point[1] - one[1]) * dz) / length
    along = min(1.0, max(0.0, along))
    return hypot(point[0] - one[0] - along * dr, point[1] - one[1] - along * dz)

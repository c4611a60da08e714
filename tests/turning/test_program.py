"""The emitted program, read by a G-code parser of another house, against the drawing (row P25)."""

from itertools import pairwise
from math import atan2, cos, hypot, pi, sin

import pytest
from pygcode import Line  # type: ignore[import-untyped]  # the package has no types

from onboard.systems.turning.drawing import ContourElement, Drawing
from onboard.systems.turning.lathe import LatheState, TurningJob
from onboard.systems.turning.process import Process, generate
from tests.turning.workshop import JOB, SHAFT, STEEL, contour, lathe

Point = tuple[float, float]
#: Asked of the contour, mm.
TOLERANCE_MM = 0.01


def _process(drawing: Drawing = SHAFT, job: TurningJob = JOB) -> Process:
    process = generate(job, drawing, STEEL, lathe(1, 60.0), LatheState())
    assert process is not None
    return process


def _moves(text: str) -> list[tuple[str, list[Point]]]:
    """Word and path (radius, z) of every move: pygcode reads the words, the geometry is worked out here."""
    here, found = (0.0, 0.0), []
    for line in text.splitlines():
        if line.startswith(("%", "O")):
            continue
        for code in Line(line).block.gcodes:
            if str(code.word) not in ("G00", "G01", "G02", "G03"):
                continue
            words = code.get_param_dict()
            there = (words["X"] / 2, words["Z"])
            centre = (here[0] + words["I"], here[1] + words["K"]) if "I" in words else None
            found.append((str(code.word), _path(here, there, centre, str(code.word))))
            here = there
    return found


def _path(start: Point, end: Point, centre: Point | None, word: str) -> list[Point]:
    if centre is None:
        return [tuple(a + (b - a) * i / 40 for a, b in zip(start, end, strict=True)) for i in range(41)]  # type: ignore[misc]  # two of them
    begin = atan2(start[0] - centre[0], start[1] - centre[1])
    turn = (atan2(end[0] - centre[0], end[1] - centre[1]) - begin) % (2 * pi)
    if word == "G02":
        turn -= 2 * pi
    radius = hypot(start[0] - centre[0], start[1] - centre[1])
    assert radius == pytest.approx(hypot(end[0] - centre[0], end[1] - centre[1]), abs=0.002)
    angles = [begin + turn * i / 40 for i in range(41)]
    return [(centre[0] + radius * sin(a), centre[1] + radius * cos(a)) for a in angles]


def _drawn(element: ContourElement) -> list[Point]:
    """Points of one element of the drawing, by its own definition: the arc's points are ``radius`` from its centre."""
    one, other = element.start, element.end
    chord = [
        (one.r_um + (other.r_um - one.r_um) * i / 40, one.u_um + (other.u_um - one.u_um) * i / 40) for i in range(41)
    ]
    if element.radius_um:
        r0, u0 = element.centre.r_um, element.centre.u_um
        scale = [abs(element.radius_um) / hypot(r - r0, u - u0) for r, u in chord]
        chord = [(r0 + (r - r0) * s, u0 + (u - u0) * s) for (r, u), s in zip(chord, scale, strict=True)]
    return [(r / 1000, -u / 1000) for r, u in chord]


def _distance(point: Point, path: list[Point]) -> float:
    return min(_to_segment(point, one, other) for one, other in pairwise(path))


def _to_segment(point: Point, one: Point, other: Point) -> float:
    dr, dz = other[0] - one[0], other[1] - one[1]
    length = dr * dr + dz * dz
    along = 0.0 if not length else ((point[0] - one[0]) * dr + (point[1] - one[1]) * dz) / length
    along = min(1.0, max(0.0, along))
    return hypot(point[0] - one[0] - along * dr, point[1] - one[1] - along * dz)


DRAWINGS = [
    SHAFT,
    Drawing(1, "pin", contour((0, 0, 0), (0, 12, 0), (40, 12, 0)), 3.2),
    Drawing(2, "ball", contour((0, 0, 0), (15, 30, 15), (30, 30, 0), (40, 44, 0)), 0.8),
    Drawing(3, "cup", contour((0, 10, 0), (8, 26, -8), (8, 40, 0), (20, 40, 0)), 1.6),
]


@pytest.mark.parametrize("drawing", DRAWINGS, ids=lambda drawing: drawing.name)
def test_p25_the_contour_that_the_program_cuts_equals_the_drawing(drawing: Drawing) -> None:
    moves = _moves(_process(drawing).program)
    cut = [path for word, path in moves if word != "G00"]
    drawn = [_drawn(element) for element in drawing.elements]
    # Every point of the drawing is on the path of some cut.
    for element in drawn:
        for point in element:
            assert min(_distance(point, path) for path in cut) <= TOLERANCE_MM
    # No cut, and no rapid move, takes away anything of the part.
    part = [point for element in drawn for point in element]
    for _, path in moves:
        for r, z in path:
            inside = [one for one in part if one[1] >= z]
            if inside and z < -1e-6:
                assert (
                    r >= max(one[0] for one in inside) - TOLERANCE_MM
                    or min(_distance((r, z), element) for element in drawn) <= TOLERANCE_MM
                )


def test_p25_five_named_stages_and_a_program_that_parses() -> None:
    process = _process()
    assert process.clamping.chuck.name == "three jaws" and not process.clamping.tailstock
    assert [tool.number for tool in process.tools] == [1, 1, 2]
    assert [one.work.value for one in process.conditions] == ["facing", "roughing", "finishing"]
    assert len(process.paths) == 3
    words = [str(code.word) for line in process.program.splitlines()[2:-1] for code in Line(line).block.gcodes]
    assert set(words[1:5]) == {"G21", "G18", "G90", "G40"}
    assert {"G42", "G96", "T0101", "T0202", "M03", "M30"} <= set(words)


def test_p25_cutting_conditions_keep_to_power_roughness_and_spindle() -> None:
    weak = generate(JOB, SHAFT, STEEL, lathe(1, 60.0, power_kw=3.0, spindle_max_rpm=1500.0), LatheState())
    assert weak is not None
    rough = next(one for one in weak.conditions if one.work.value == "roughing")
    power_kw = STEEL.cutting_force_n_mm2 * rough.depth_mm * rough.feed_mm * rough.speed_m_min / 60_000
    assert power_kw == pytest.approx(3.0 * 0.8)
    assert rough.rpm(10.0) == 1500.0 and rough.rpm(100.0) == pytest.approx(1000 * 180 / (pi * 100))
    finish = weak.conditions[-1]
    assert finish.feed_mm**2 / (32 * finish.tool.nose_mm) * 1000 <= SHAFT.roughness_um + 1e-9
    assert weak.machining_min > _process().machining_min


def test_p25_a_long_thin_bar_needs_the_tailstock_and_a_thick_one_other_jaws() -> None:
    job = TurningJob(12, 1, 22.0)
    thin = Drawing(12, "needle", contour((0, 0, 0), (0, 20, 0), (90, 20, 0)), 3.2)
    assert generate(job, thin, STEEL, lathe(1, 60.0), LatheState()) is None
    supported = generate(job, thin, STEEL, lathe(1, 60.0, has_tailstock=True), LatheState())
    assert supported is not None and supported.clamping.tailstock
    assert generate(TurningJob(12, 1, 170.0), SHAFT, STEEL, lathe(1, 60.0), LatheState()) is None

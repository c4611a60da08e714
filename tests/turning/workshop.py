"""Lathes, material and drawings of the tests."""

from itertools import pairwise

from onboard.systems.turning.drawing import At, ContourElement, Drawing
from onboard.systems.turning.lathe import Chuck, Lathe, LatheOperation, Material, Tool, TurningJob

STEEL = Material(1, "C45", 2100.0, 1.6, 7.85)
EVERYTHING = (LatheOperation.FACE, LatheOperation.ROUGH)


def tools(**changes: float) -> tuple[Tool, ...]:
    """A roughing and a finishing tool; ``changes`` to the first."""
    rough = {"speed_m_min": 180.0, "depth_mm": 2.5, "feed_mm": 0.3, "nose_mm": 0.8, "edge_eur": 8.0, "life_min": 20.0}
    return (
        Tool(1, EVERYTHING, **(rough | changes)),
        Tool(2, (LatheOperation.FINISH,), 240.0, 0.8, 0.25, 0.4, 6.0, 15.0),
    )


def contour(*points: tuple[float, float, float]) -> tuple[ContourElement, ...]:
    """Elements through points (depth mm, diameter mm, arc radius mm), the first with radius 0."""
    ats = [At(1000 * depth, 500 * diameter) for depth, diameter, _ in points]
    return tuple(
        ContourElement(one, other, 1000 * radius)
        for (one, other), (_, _, radius) in zip(pairwise(ats), points[1:], strict=True)
    )


#: A face, a rounded edge, a cylinder, a fillet, a face, a taper and a cylinder: every kind of element.
SHAFT = Drawing(
    12,
    "shaft",
    contour((0, 0, 0), (0, 16, 0), (2, 20, 2), (25, 20, 0), (28, 26, -3), (28, 30, 0), (43, 40, 0), (60, 40, 0)),
    1.6,
)
JOB = TurningJob(12, 1, 45.0, batch=10)


def lathe(node: int, hourly_eur: float, **changes: object) -> Lathe:
    """A lathe of middle size."""
    base: dict[str, object] = {
        "power_kw": 11.0,
        "spindle_max_rpm": 4000.0,
        "reach_mm": 250.0,
        "chucks": (Chuck("three jaws", 20.0, 160.0, 20.0),),
        "tools": tools(),
    }
    return Lathe(node, f"L{node}", hourly_eur, **(base | changes))  # type: ignore[arg-type]  # tests vary any field

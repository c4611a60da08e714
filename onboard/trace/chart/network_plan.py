"""A network from above: places, the ways between them, who is at home where; to one scale, which a bar tells."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import dist

from onboard.trace.chart.svg import SvgDrawing
from onboard.trace.scene.arrange import arrange
from onboard.trace.scene.scene import Spot

#: Most and least width of the whole (its words need that), and room at the edges and above, px.
_WIDTH, _LEAST_WIDTH, _EDGE, _HEAD = 1_200.0, 640.0, 40.0, 70.0
_WAY, _ROBOT = "#9a9a9a", "#000000"
#: Share of a way at which the tip of a one-way one is, and half of a tip, px.
_TIP, _TIP_PX = 0.6, 5.0


@dataclass(frozen=True, slots=True)
class PlanPlace:
    """Where it is in the site's own unit, what is written on it, its colour, and who begins there."""

    spot: Spot
    name: str = ""
    fill: str = "#e4e4e4"
    robots: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanWay:
    """From one place to another, with what is written beside it."""

    start: int
    end: int
    words: str = ""
    is_one_way: bool = False


def spread(lengths: Mapping[tuple[int, int], float], places: Sequence[int]) -> tuple[dict[int, Spot], float]:
    """Spots in the unit of ``lengths``, where a file names no places; the most by which a drawn way is off, as a share.

    Lengths alone need not fit a plane.
    """
    spots = arrange(lengths, list(places), 1.0)
    drawn = {(one, other): dist(spots[one], spots[other]) for one, other in lengths}
    scale = sum(lengths.values()) / (sum(drawn.values()) or 1.0)
    off = max((abs(drawn[ends] * scale / length - 1) for ends, length in lengths.items()), default=0.0)
    return {place: (x * scale, y * scale) for place, (x, y) in spots.items()}, off


def draw_plan(
    title: str,
    notes: Sequence[str],
    places: Mapping[int, PlanPlace],
    ways: Sequence[PlanWay],
    *,
    size: float,
    most_scale: float,
    bar: tuple[float, str],
) -> SvgDrawing:
    """The picture: ``notes`` above it, each place a square of ``size`` units, at most ``most_scale`` px a unit.

    ``bar`` is how many units its words stand for.
    """
    left, top = (min(one.spot[axis] for one in places.values()) - size / 2 for axis in (0, 1))
    right, low = (max(one.spot[axis] for one in places.values()) + size / 2 for axis in (0, 1))
    scale = min(most_scale, (_WIDTH - 2 * _EDGE) / max(right - left, 1e-9))
    head = _HEAD + 14 * len(notes)
    wide = max((right - left) * scale + 2 * _EDGE, _LEAST_WIDTH)
    drawing = SvgDrawing(wide, head + (low - top) * scale + _EDGE, title)
    drawing.text(10, 18, title, fill="#000000")
    drawing.line([(_EDGE, 32), (_EDGE + bar[0] * scale, 32)], "#000000", width=2)
    drawing.text(_EDGE + bar[0] * scale + 6, 36, bar[1])
    for number, note in enumerate(notes):
        drawing.text(10, 54 + 14 * number, note)
    spots = {
        place: (_EDGE + (one.spot[0] - left) * scale, head + (one.spot[1] - top) * scale)
        for place, one in places.items()
    }
    for way in ways:
        _draw_way(drawing, spots[way.start], spots[way.end], way)
    half = size * scale / 2
    for place, one in places.items():
        drawing.area(_square(*spots[place], half), one.fill, opacity=1, note=one.name)
    for place, one in places.items():
        _name_place(drawing, *spots[place], half, one)
    return drawing


def _draw_way(drawing: SvgDrawing, start: Spot, end: Spot, way: PlanWay) -> None:
    drawing.line([start, end], _WAY, width=2)
    (x, y), (x2, y2) = start, end
    drawing.text((x + x2) / 2 + 3, (y + y2) / 2 - 3, way.words, fill="#555555")
    if way.is_one_way:
        length = dist(start, end) or 1.0
        dx, dy = _TIP_PX * (x2 - x) / length, _TIP_PX * (y2 - y) / length
        at_x, at_y = x + (x2 - x) * _TIP, y + (y2 - y) * _TIP
        tips = [(at_x + dx, at_y + dy), (at_x - dx - dy, at_y - dy + dx), (at_x - dx + dy, at_y - dy - dx)]
        drawing.area(tips, _WAY, opacity=1)


def _name_place(drawing: SvgDrawing, x: float, y: float, half: float, one: PlanPlace) -> None:
    if one.robots:
        inner, words = half * 0.7, " ".join(one.robots)
        if one.name:
            drawing.area([(x - inner, y), (x, y - inner), (x + inner, y), (x, y + inner)], _ROBOT, opacity=0.75)
            drawing.text(x, y + half + 11, words, anchor="middle", fill=_ROBOT)
        else:
            # A cell beside it may have a robot too: what is written below this one would be behind that.
            drawing.area(_square(x, y, half), _ROBOT, opacity=1)
            drawing.text(x, y + 4, words, anchor="middle", fill="#ffffff")
    if one.name:
        drawing.text(x, y - half - 3, one.name, anchor="middle")


def _square(x: float, y: float, half: float) -> list[Spot]:
    return [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)]

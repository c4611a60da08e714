"""How far a robot takes a part of which it cannot reach the goal: the paper's three offers (row C09, section 4).

The paper leaves "maximum displacement towards the goal" open. Its printed run has one reading that fits: equal steps in
x and in y until a limit of the working area (the via point (30, 18); the straight line's last point, or the corner
nearest to the goal, cannot give it). An axis that has come to the goal's coordinate takes no more steps.
"""

from collections.abc import Callable

from onboard.systems.cell.geometry import Area, Point

#: Where a robot with this working area, taking a part at ``start``, would put it down on its way to ``end``.
OfferRule = Callable[[Area, Point, Point], Point]


def equal_steps(area: Area, start: Point, end: Point) -> Point:
    """Offer 1: the same number of steps in x and in y towards the goal, until a limit of the area."""
    x_mm, x_room = _towards(start.x_mm, end.x_mm, area.x0_mm, area.x1_mm)
    y_mm, y_room = _towards(start.y_mm, end.y_mm, area.y0_mm, area.y1_mm)
    # An axis that comes to the goal before its limit does not stop the other.
    limits = [room for room, way in ((x_room, x_mm), (y_room, y_mm)) if room < abs(way)]
    steps = min(limits, default=max(abs(x_mm), abs(y_mm)))
    return Point(start.x_mm + _clipped(x_mm, steps), start.y_mm + _clipped(y_mm, steps))


def closest_in_x(area: Area, start: Point, end: Point) -> Point:
    """Offer 2: as close to the goal's x as the area allows, y unchanged."""
    return Point(min(max(end.x_mm, area.x0_mm), area.x1_mm), start.y_mm)


def closest_in_y(area: Area, start: Point, end: Point) -> Point:
    """Offer 3: as close to the goal's y as the area allows, x unchanged."""
    return Point(start.x_mm, min(max(end.y_mm, area.y0_mm), area.y1_mm))


#: The three offers in the paper's order.
OFFERS: tuple[OfferRule, ...] = (equal_steps, closest_in_x, closest_in_y)


def via_points(
    area: Area, start: Point, end: Point, obstacles: tuple[Area, ...], rules: tuple[OfferRule, ...] = OFFERS
) -> tuple[Point, ...]:
    """Where a robot could hand the part over, in the order of the rules, each point once.

    Empty where the area lacks the start, or where no rule moves the part to a place that an obstacle leaves free.
    """
    if not area.contains(start):
        return ()
    points = dict.fromkeys(rule(area, start, end) for rule in rules)
    return tuple(point for point in points if point != start and not any(one.hides(point) for one in obstacles))


def _towards(start: int, end: int, low: int, high: int) -> tuple[int, int]:
    """The signed way to the goal along one axis, and the room in that direction, both in mm."""
    return end - start, (high - start if end > start else start - low)


def _clipped(way_mm: int, steps_mm: int) -> int:
    return max(-steps_mm, min(steps_mm, way_mm))

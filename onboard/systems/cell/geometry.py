"""The cell's plane: points, areas along the axes, obstacles, and the shortest way between two points of an area.

Robots and parts are points (row C01). Coordinates are whole millimetres, so every question about what touches what has
an exact answer; lengths are metres as doubles, as the paper prints them.
"""

import heapq
from fractions import Fraction
from itertools import pairwise
from math import hypot
from typing import NamedTuple

_MM = 1000


class Point(NamedTuple):
    """A point of the plane, in mm."""

    x_mm: int
    y_mm: int


class Area(NamedTuple):
    """A closed rectangle along the axes, in mm, with ``x0 <= x1`` and ``y0 <= y1``: a working area or an obstacle."""

    x0_mm: int
    y0_mm: int
    x1_mm: int
    y1_mm: int

    def contains(self, point: Point) -> bool:
        """Whether the point is in it or on its border."""
        return self.x0_mm <= point.x_mm <= self.x1_mm and self.y0_mm <= point.y_mm <= self.y1_mm

    def hides(self, point: Point) -> bool:
        """Whether the point is inside and not on the border: nothing can be there if this is an obstacle."""
        return self.x0_mm < point.x_mm < self.x1_mm and self.y0_mm < point.y_mm < self.y1_mm

    def corners(self) -> tuple[Point, Point, Point, Point]:
        """The four corners, mm, counter-clockwise from the lowest x and y."""
        return (
            Point(self.x0_mm, self.y0_mm),
            Point(self.x1_mm, self.y0_mm),
            Point(self.x1_mm, self.y1_mm),
            Point(self.x0_mm, self.y1_mm),
        )


def distance_m(one: Point, other: Point) -> float:
    """Straight distance of two points, in m, as the paper's costs have it."""
    return hypot((other.x_mm - one.x_mm) / _MM, (other.y_mm - one.y_mm) / _MM)


def crosses(one: Point, other: Point, obstacle: Area) -> bool:
    """Whether the straight line between two points goes through the inside of an obstacle; along its border is free."""
    first, last = Fraction(0), Fraction(1)
    for start, step, low, high in (
        (one.x_mm, other.x_mm - one.x_mm, obstacle.x0_mm, obstacle.x1_mm),
        (one.y_mm, other.y_mm - one.y_mm, obstacle.y0_mm, obstacle.y1_mm),
    ):
        if step == 0:
            if not low < start < high:
                return False
            continue
        enters, leaves = sorted((Fraction(low - start, step), Fraction(high - start, step)))
        first, last = max(first, enters), min(last, leaves)
    return first < last or (one == other and obstacle.hides(one))


def shortest_way(start: Point, end: Point, area: Area, obstacles: tuple[Area, ...]) -> tuple[Point, ...] | None:
    """The points of the shortest way within ``area`` around all obstacles, both ends included; None without one.

    A shortest way among polygons bends at their corners only (Lozano-Perez, Wesley 1979), so it is searched for among
    the corners that the area holds (Dijkstra 1959). Equal ways: the one whose points sort first.
    """
    if not (area.contains(start) and area.contains(end)) or any(o.hides(start) or o.hides(end) for o in obstacles):
        return None
    if not any(crosses(start, end, obstacle) for obstacle in obstacles):
        return (start, end)
    corners = [c for o in obstacles for c in o.corners() if area.contains(c) and not any(p.hides(c) for p in obstacles)]
    nodes = sorted({*corners, end} - {start})
    queue: list[tuple[float, tuple[Point, ...]]] = [(0.0, (start,))]
    done: set[Point] = set()
    while queue:
        length_m, way = heapq.heappop(queue)
        here = way[-1]
        if here == end:
            return way
        if here in done:
            continue
        done.add(here)
        for node in nodes:
            if node not in done and not any(crosses(here, node, obstacle) for obstacle in obstacles):
                heapq.heappush(queue, (length_m + distance_m(here, node), (*way, node)))
    return None


def way_length_m(way: tuple[Point, ...]) -> float:
    """Length of a way along its points, in m."""
    return sum(distance_m(one, other) for one, other in pairwise(way))

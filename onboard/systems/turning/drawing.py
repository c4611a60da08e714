"""The drawing of a turned part: its contour from the front face towards the chuck, in whole micrometres.

``u`` is the depth behind the front face, ``r`` the radius. A contour never falls back towards the axis (no undercut),
so one right-hand tool can follow it: cylinders, faces, tapers, and arcs of at most a quarter circle.
"""

from dataclasses import dataclass
from enum import Enum
from math import hypot, sqrt
from typing import NamedTuple


class At(NamedTuple):
    """A point of the contour: depth ``u_um`` behind the front face and radius ``r_um``, both 0 or more."""

    u_um: float
    r_um: float


class Shape(Enum):
    """What an element of a contour is called."""

    CYLINDER = "cylinder"
    FACE = "face"
    TAPER = "taper"
    ARC = "arc"


@dataclass(frozen=True, slots=True)
class ContourElement:
    """One element from ``start`` to ``end``; ``radius_um`` 0: straight, above 0: a convex arc, below 0: concave."""

    start: At
    end: At
    radius_um: float = 0

    @property
    def shape(self) -> Shape:
        """Its name in a drawing."""
        if self.radius_um:
            return Shape.ARC
        if self.start.r_um == self.end.r_um:
            return Shape.CYLINDER
        return Shape.FACE if self.start.u_um == self.end.u_um else Shape.TAPER

    @property
    def length_um(self) -> float:
        """Straight distance from start to end."""
        return hypot(self.end.u_um - self.start.u_um, self.end.r_um - self.start.r_um)

    @property
    def centre(self) -> At:
        """Centre of an arc: below and behind the chord where convex, above and before it where concave."""
        half = self.length_um / 2
        du, dr = self.end.u_um - self.start.u_um, self.end.r_um - self.start.r_um
        height = sqrt(max(0.0, self.radius_um**2 - half**2)) * (1 if self.radius_um > 0 else -1)
        mid = At((self.start.u_um + self.end.u_um) / 2, (self.start.r_um + self.end.r_um) / 2)
        return At(mid.u_um + height * dr / (2 * half), mid.r_um - height * du / (2 * half))

    def depth_at(self, r_um: float) -> float:
        """Greatest depth at which the element is no thicker than ``r_um``, a radius between its ends."""
        if r_um >= self.end.r_um:
            return self.end.u_um
        if not self.radius_um:
            share = (r_um - self.start.r_um) / (self.end.r_um - self.start.r_um)
            return self.start.u_um + share * (self.end.u_um - self.start.u_um)
        centre = self.centre
        reach = sqrt(max(0.0, self.radius_um**2 - (r_um - centre.r_um) ** 2))
        return centre.u_um - reach if self.radius_um > 0 else centre.u_um + reach


def element_fault(element: ContourElement) -> tuple[str, str] | None:
    """What is wrong with an element and the remedy, or None: it falls back, is no arc, or bends more than a quarter."""
    start, end = element.start, element.end
    if end.u_um < start.u_um or end.r_um < start.r_um:
        return "an undercut", "let depth and diameter only grow towards the chuck"
    if start == end:
        return "an element without length", "leave it out"
    if not element.radius_um:
        return None
    if abs(element.radius_um) * 2 < element.length_um:
        return "an arc that does not reach from start to end", "give it a larger radius"
    centre = element.centre
    slack = 0.5
    if element.radius_um > 0:
        inside = centre.u_um >= end.u_um - slack and centre.r_um <= start.r_um + slack
    else:
        inside = centre.u_um <= start.u_um + slack and centre.r_um >= end.r_um - slack
    return None if inside else ("an arc that bends back", "split it, or give it a larger radius")


@dataclass(frozen=True, slots=True)
class Drawing:
    """A turned part: ``number`` names it on the bus; the contour begins at depth 0.

    ``roughness_um`` is the arithmetic mean roughness Ra asked for (ISO 4287), above 0.
    """

    number: int
    name: str
    elements: tuple[ContourElement, ...]
    roughness_um: float

    @property
    def length_mm(self) -> float:
        """Depth of the last point."""
        return self.elements[-1].end.u_um / 1000

    @property
    def diameter_mm(self) -> float:
        """The largest diameter of the part, mm."""
        return self.elements[-1].end.r_um / 500

    @property
    def front_um(self) -> float:
        """Radius of the flat front face, 0 where the part begins as a point or a round end."""
        first = self.elements[0]
        return first.end.r_um if first.shape is Shape.FACE else first.start.r_um

    def behind_front(self) -> tuple[ContourElement, ...]:
        """The contour without the flat front face, which facing makes."""
        return self.elements[1:] if self.elements[0].shape is Shape.FACE else self.elements

    def depth_um(self, r_um: float) -> float:
        """How far a cut along the axis at radius ``r_um`` may go: the greatest depth no thicker, 0 for none."""
        depth = 0.0
        for element in self.elements:
            if element.start.r_um > r_um:
                break
            depth = element.depth_at(r_um)
        return depth

"""An alley as a carrier's drive sees it: positions in mm, slots with tokens, and the lifts' platforms at its ends."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from onboard.core.lifts import gate, lift_at, platform
from onboard.core.site import Segment, Site


@dataclass(frozen=True)
class AlleyAxis:
    """The axis of the alley of ``floor``: index 1 at 0 mm; index 0 and length + 1 where a lift stops at that end."""

    site: Site
    floor: int

    @cached_property
    def lowest(self) -> int:
        """First index of the axis."""
        return 1 if lift_at(self.site, Segment(self.floor, 0)) is None else 0

    @cached_property
    def highest(self) -> int:
        """Last index of the axis."""
        length = self.site.tracks[self.floor].length
        return length if lift_at(self.site, Segment(self.floor, length + 1)) is None else length + 1

    def position_mm(self, index: int) -> int:
        """Centre of an index."""
        return (index - 1) * self.site.tracks[self.floor].pitch_mm

    def index_at(self, position_mm: int) -> int:
        """The index whose span holds a position."""
        pitch_mm = self.site.tracks[self.floor].pitch_mm
        return max(self.lowest, min(self.highest, (position_mm + pitch_mm // 2) // pitch_mm + 1))

    def slot(self, index: int) -> Segment:
        """The body slot of an index: an alley segment, or a lift's platform."""
        lift = lift_at(self.site, Segment(self.floor, index))
        return Segment(self.floor, index) if lift is None else platform(lift)

    def crossing(self, index: int, other: int) -> list[Segment]:
        """The gate between two neighbouring indices, where one is a platform; else nothing."""
        for one in (index, other):
            lift = lift_at(self.site, Segment(self.floor, one))
            if lift is not None and index != other:
                return [gate(lift)]
        return []

    def rights(self, indices: list[int]) -> list[list[Segment]]:
        """What must be held to have the body at each of a line of neighbouring indices, entered in this order."""
        needed = []
        for place, index in enumerate(indices):
            before = indices[place - 1] if place else index
            needed.append([self.slot(index), *self.crossing(before, index)])
        return needed

    def overlapped(self, low_mm: int, high_mm: int) -> list[Segment]:
        """Slots that a body from ``low_mm`` to ``high_mm`` is in, and the gate where it is across a sill."""
        indices = list(range(self.index_at(low_mm), self.index_at(high_mm) + 1))
        held = [self.slot(index) for index in indices]
        for one, other in pairwise(indices):
            held += self.crossing(one, other)
        return held

"""A track as a carrier's drive sees it: positions in mm, slots with tokens, and what lies beyond its ends."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

from onboard.core.site import Segment
from onboard.ways.lifts import gate, lift_at, platform
from onboard.ways.site import Track, WaySite

#: How far ahead of the braking distance segments are asked for, in us of travel at top speed: tokens take a few
#: journal writes and frames.
LOOKAHEAD_US = 3_000_000


@dataclass(frozen=True)
class TrackAxis:
    """The axis of an alley or a spur: index 1 at 0 mm.

    Index 0 and length + 1 are the platforms of the lifts that stop there, or the mouths of linked ends, a pitch beyond:
    a body there is turned, or turning, and needs both slots.
    """

    site: WaySite
    number: int
    #: Worked out of the site, which never changes: rights by index before and index entered, slots by a body's ends.
    _rights: dict[tuple[int, int], list[Segment]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _overlaps: dict[tuple[int, int], list[Segment]] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def track(self) -> Track:
        """The alley or spur that the axis lies along."""
        return self.site.tracks[self.number]

    @cached_property
    def pitch_mm(self) -> int:
        """From one index to the next."""
        return self.track.pitch_mm

    @cached_property
    def soon(self) -> int:
        """How many segments ahead a carrier needs soon: the braking distance, and what it travels while it asks."""
        carrier = self.site.carrier
        braking_mm = carrier.speed_mm_s**2 // (2 * carrier.acceleration_mm_s2)
        ahead_mm = braking_mm + carrier.speed_mm_s * LOOKAHEAD_US // 1_000_000
        return 2 + -(-ahead_mm // self.pitch_mm)

    @cached_property
    def mouths(self) -> dict[int, Segment]:
        """By index the segments of other tracks in which this one's linked ends are."""
        return dict(self.track.ends)

    @cached_property
    def lowest(self) -> int:
        """First index of the axis."""
        return 0 if self._goes_on(0) else 1

    @cached_property
    def highest(self) -> int:
        """Last index of the axis."""
        return self.track.length + self._goes_on(self.track.length + 1)

    def _goes_on(self, index: int) -> bool:
        return index in self.mouths or lift_at(self.site, Segment(self.number, index)) is not None

    def end_at(self, mouth: Segment) -> int | None:
        """The index that a segment of another track is on this one, None where this one does not end there."""
        return next((index for index, at in self.mouths.items() if at == mouth), None)

    @cached_property
    def lifts(self) -> tuple[int, ...]:
        """Lifts, by track, whose platforms are at the ends of this axis."""
        ends = (lift_at(self.site, Segment(self.number, index)) for index in (0, self.track.length + 1))
        return tuple(lift for lift in ends if lift is not None)

    def position_mm(self, index: int) -> int:
        """Centre of a segment, mm from that of index 1."""
        return (index - 1) * self.pitch_mm

    def index_at(self, position_mm: int) -> int:
        """The index whose span holds a position."""
        index = (position_mm + self.pitch_mm // 2) // self.pitch_mm + 1
        return max(self.lowest, min(self.highest, index))

    def slot(self, index: int) -> Segment:
        """The body slot of an index: a segment of the track, a lift's platform, or a mouth."""
        mouth = self.mouths.get(index)
        if mouth is not None:
            return mouth
        lift = lift_at(self.site, Segment(self.number, index))
        return Segment(self.number, index) if lift is None else platform(lift)

    def crossing(self, index: int, other: int) -> list[Segment]:
        """The gate between two neighbouring indices, where one is a platform; else nothing."""
        for one in (index, other):
            lift = lift_at(self.site, Segment(self.number, one))
            if lift is not None and index != other:
                return [gate(lift)]
        return []

    def rights(self, indices: list[int]) -> list[list[Segment]]:
        """What must be held to have the body at each of a line of neighbouring indices, entered in this order."""
        entered = zip(indices[:1] + indices, indices, strict=False)
        return [self._rights.get(step) or self._rights_of(*step) for step in entered]

    def _rights_of(self, before: int, index: int) -> list[Segment]:
        needed = [self.slot(index), *self._beside(index), *self.crossing(before, index)]
        self._rights[before, index] = needed
        return needed

    def overlapped(self, low_mm: int, high_mm: int) -> list[Segment]:
        """Slots that a body from ``low_mm`` to ``high_mm`` is in, and the gate where it is across a sill."""
        ends = self.index_at(low_mm), self.index_at(high_mm)
        return list(self._overlaps.get(ends) or self._overlap_of(*ends))

    def _overlap_of(self, lowest: int, highest: int) -> list[Segment]:
        indices = list(range(lowest, highest + 1))
        held = [self.slot(index) for index in indices]
        for one, other in pairwise(indices):
            held += self.crossing(one, other)
        for index in dict.fromkeys((indices[-1], indices[0])):
            held += [slot for slot in self._beside(index) if slot not in held]
        self._overlaps[lowest, highest] = held
        return held

    def _beside(self, index: int) -> list[Segment]:
        """What a body needs beside the slot that it is in: whoever turns in a mouth, the segment inside."""
        return [self.track.inside(index)] if index in self.mouths else []

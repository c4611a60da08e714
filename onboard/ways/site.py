"""A site whose machines move along tracks, as plain values.

Words: a *track* is a line of *segments* (an alley, a lift shaft, a spur); ``Segment(track, index)`` is one body slot of
it, written p(k,i) on the alley of floor k (row P31). A *station* is where a car can stand: a place or a compartment, on
one side of a segment.
"""

from dataclasses import dataclass, field, fields
from enum import Enum
from functools import cached_property, singledispatch

from onboard.core.site import Segment, Site, Station


class TrackKind(Enum):
    """What a track is."""

    ALLEY = "alley"
    LIFT = "lift"
    SPUR = "spur"


@dataclass(frozen=True, slots=True)
class Track:
    """A line of ``length`` segments, indices 1 to ``length``, centres ``pitch_mm`` apart; index 1 at 0 mm.

    Alleys are tracks 1 to 127 and their number is the floor; lifts 128 to 191 with one segment per floor served;
    spurs 192 to 254, joined to ``joins`` on an alley.
    """

    number: int
    kind: TrackKind
    length: int
    pitch_mm: int
    joins: tuple[Segment, ...] = ()


@dataclass(frozen=True, slots=True)
class Axis:
    """Limits of one moving axis: top speed in mm/s, acceleration and braking in mm/s^2, both above 0."""

    speed_mm_s: int
    acceleration_mm_s2: int


#: A site without machines that move along tracks: nobody reads it.
_NO_AXIS = Axis(1, 1)


@dataclass(frozen=True, kw_only=True)
class WaySite(Site):
    """A site with tracks; their numbers are those of its stewards. What is not said is that of a site that has none."""

    tracks: dict[int, Track] = field(default_factory=dict)
    #: In the order of the file's floors, sides and indices.
    places: tuple[Station, ...] = ()
    carrier: Axis = _NO_AXIS
    carrier_length_mm: int = 0
    carrier_clearance_mm: int = 0
    #: How long a carrier takes to turn from an alley into a spur, or back, standing in the spur's mouth.
    carrier_turn_us: int = 0
    lift: Axis = _NO_AXIS
    floor_height_mm: int = 0

    @cached_property
    def compartments(self) -> dict[int, Station]:
        """Station of each compartment by node-ID."""
        return {m.node_id: m.station for m in self.machines.values() if m.station is not None}

    @cached_property
    def lifts(self) -> tuple[int, ...]:
        """Track numbers of all lifts, in the site's order."""
        return tuple(number for number, track in self.tracks.items() if track.kind is TrackKind.LIFT)

    @cached_property
    def platforms(self) -> dict[Segment, int]:
        """Lift track by the platform's position on each alley served: index 0 at the left end, length + 1 at the right.

        Worked out once: every motion asks for it many times.
        """
        found: dict[Segment, int] = {}
        for lift in self.lifts:
            for at in self.tracks[lift].joins:
                end = 0 if at.index == 1 else self.tracks[at.track].length + 1
                found.setdefault(Segment(at.track, end), lift)
        return found

    @cached_property
    def spurs(self) -> dict[Segment, int]:
        """Spur track by its mouth: the alley segment that it joins, and no other spur does."""
        return {
            mouth: track.number
            for track in self.tracks.values()
            if track.kind is TrackKind.SPUR
            for mouth in track.joins
        }

    def position_mm(self, segment: Segment) -> int:
        """Centre of a segment along its track, in mm from that of index 1."""
        return (segment.index - 1) * self.tracks[segment.track].pitch_mm


@singledispatch
def way_site(site: Site) -> WaySite:
    """The same site with its tracks; one whose machines do not move along any has none."""
    return WaySite(**{one.name: getattr(site, one.name) for one in fields(Site)})


@way_site.register
def _(site: WaySite) -> WaySite:
    return site

"""A site whose machines move along tracks, as plain values.

Words: a *track* is a line of *segments* (an alley, a lift shaft, a spur); ``Segment(track, index)`` is one body slot of
it, written p(k,i) on the alley of floor k (row P31). A *station* is where a car can stand: a place or a compartment, on
one side of a segment. An end of an alley or spur can be *linked*: the position beyond it, index 0 or length + 1, is a
segment of another track at a right angle, its *mouth*, where a carrier turns. So alleys turn, branch, cross, and close
to rings; which tracks are at one mouth never matters to who has its token.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from functools import cached_property, singledispatch
from typing import NamedTuple

from onboard.contract.codes import KindCode, Side
from onboard.core.site import Segment, Site, Station


class TrackKind(Enum):
    """What a track is for: driving along, between floors, or aside."""

    ALLEY = "alley"
    LIFT = "lift"
    SPUR = "spur"


class Offset(NamedTuple):
    """A place on a track: ``position_mm`` from the centre of its index 1."""

    track: int
    position_mm: int


class BayUse(Enum):
    """What a compartment is for."""

    ENTRY = "entry"
    EXIT = "exit"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Track:
    """A line of ``length`` segments, indices 1 to ``length``, centres ``pitch_mm`` apart; index 1 at 0 mm.

    Alleys are tracks 1 to 127, lifts 128 to 191 with one segment per stop, spurs 192 to 254. ``joins`` are a lift's
    sills, one for each door at each stop, or the mouth of another track's low end; ``high`` is the mouth of its other
    end, and ``side`` the side of the mouth's track on which it goes off (that of the low one where it has both).
    """

    number: int
    kind: TrackKind
    length: int
    pitch_mm: int
    joins: tuple[Segment, ...] = ()
    high: Segment | None = None
    side: Side = Side.FAR
    #: Its floor; 0: an alley's own number, or that of the mouth (``WaySite.level``).
    level: int = 0
    #: Carriers go both ways (0), by growing index only (1), or by falling index only (-1).
    one_way: int = 0
    #: Of a lift: height of each stop above the first, never falling; empty: ``pitch_mm`` apart. Doors of one stop have
    #: the same.
    heights_mm: tuple[int, ...] = ()
    #: Where index 1 is on the tape by which drives measure their way (``charted``).
    origin_mm: int = 0

    @property
    def low(self) -> Segment | None:
        """The mouth of the low end of an alley or spur, or None."""
        return self.joins[0] if self.joins and self.kind is not TrackKind.LIFT else None

    @property
    def ends(self) -> tuple[tuple[int, Segment], ...]:
        """Each linked end: the index beyond it, and its mouth."""
        beyond = ((0, self.low), (self.length + 1, self.high))
        return tuple((index, mouth) for index, mouth in beyond if mouth is not None)

    def inside(self, index: int) -> Segment:
        """The segment next to a position beyond an end."""
        return Segment(self.number, 1 if index == 0 else self.length)

    def goes(self, from_index: int, to_index: int) -> bool:
        """Whether carriers may go in this direction."""
        return not self.one_way or (to_index - from_index) * self.one_way >= 0


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
    #: By node-ID what compartments are for that are not for both.
    bay_uses: dict[int, BayUse] = field(default_factory=dict)

    @cached_property
    def compartments(self) -> dict[int, Station]:
        """Station of each compartment by node-ID."""
        return {m.node_id: m.station for m in self.machines.values() if m.station is not None}

    def fronts(self, *uses: BayUse) -> list[Segment]:
        """Segments before compartments for any of ``uses``."""
        uses_of = ((self.bay_uses.get(node, BayUse.BOTH), bay) for node, bay in self.compartments.items())
        return [bay.segment for use, bay in uses_of if use in uses]

    @cached_property
    def robots(self) -> tuple[int, ...]:
        """Node-IDs of the machines that move by themselves along its tracks, rising."""
        return tuple(node for node, machine in sorted(self.machines.items()) if machine.kind is KindCode.ROBOT)

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
                found.setdefault(self.beyond(at), lift)
        return found

    def beyond(self, sill: Segment) -> Segment:
        """The position of the platform behind a sill, at the end of its track that is not linked."""
        track = self.tracks[sill.track]
        return Segment(sill.track, 0 if sill.index == 1 and track.low is None else track.length + 1)

    def doors(self, lift: int, lift_index: int) -> list[Segment]:
        """Sills of a lift's doors at one stop, by the index of any of them."""
        track = self.tracks[lift]
        heights_mm = track.heights_mm or range(track.length)
        height_mm = heights_mm[lift_index - 1]
        return [sill for sill, other_mm in zip(track.joins, heights_mm, strict=True) if other_mm == height_mm]

    def turned_into(self, slots: Collection[Segment]) -> int | None:
        """The track into which a body in these slots is turned, or turning, as its mouth is one of them; else None."""
        tracks = (self.tracks[slot.track] for slot in slots)
        return next((track.number for track in tracks if any(mouth in slots for _, mouth in track.ends)), None)

    @cached_property
    def spurs(self) -> dict[Segment, int]:
        """Spur track by its mouth, for pictures; the first of several at one mouth."""
        found: dict[Segment, int] = {}
        for track in self.tracks.values():
            if track.kind is TrackKind.SPUR and track.low is not None:
                found.setdefault(track.low, track.number)
        return found

    @cached_property
    def links(self) -> dict[Segment, tuple[Segment, ...]]:
        """By mouth the positions beyond linked ends that it is, in the order of the site's tracks."""
        found: dict[Segment, tuple[Segment, ...]] = {}
        for track in self.tracks.values():
            for index, mouth in track.ends:
                found[mouth] = (*found.get(mouth, ()), Segment(track.number, index))
        return found

    @cached_property
    def mouths(self) -> dict[Segment, Segment]:
        """The mouth that each position beyond a linked end is: whoever is there is turned towards that track."""
        return {end: mouth for mouth, ends in self.links.items() for end in ends}

    @cached_property
    def extents(self) -> dict[tuple[int, float, float], tuple[Segment, ...]]:
        """Slots of bodies from one position to another on a track, as whoever judges a log has worked them out."""
        return {}

    @cached_property
    def _crosswise(self) -> frozenset[int]:
        return frozenset(_crosswise(self.tracks))

    def across(self, track: int) -> bool:
        """Whether a track lies at a right angle to the site's main direction."""
        return track in self._crosswise

    @cached_property
    def is_charted(self) -> bool:
        """Whether each track has its own stretch of the tape, so that a drive's position alone tells the track."""
        return any(track.origin_mm for track in self.tracks.values())

    def on_tape(self, tape_mm: int) -> Offset | None:
        """Where a drive's position is, where the tracks are charted; None for a position of no track."""
        for track in self.tracks.values():
            if track.kind is not TrackKind.LIFT:
                position_mm = tape_mm - track.origin_mm
                if abs(2 * position_mm - (track.length - 1) * track.pitch_mm) < (track.length + 5) * track.pitch_mm:
                    return Offset(track.number, position_mm)
        return None

    def level(self, track: int) -> int:
        """The floor of an alley or spur."""
        seen = {track}
        while True:
            one = self.tracks[track]
            if one.level or not one.ends or one.kind is TrackKind.LIFT:
                return one.level or one.number
            track = one.ends[0][1].track
            if track in seen:
                return min(seen)
            seen.add(track)

    def position_mm(self, segment: Segment) -> int:
        """Centre of a segment along its track, in mm from that of index 1; of a stop of a lift its height."""
        heights_mm = self.tracks[segment.track].heights_mm
        if 0 < segment.index <= len(heights_mm):
            return heights_mm[segment.index - 1]
        return (segment.index - 1) * self.tracks[segment.track].pitch_mm


#: Tape that is left free between two tracks, in segments: a body at a position beyond an end is still on its track's.
_TAPE_GAP = 8


def charted(tracks: dict[int, Track]) -> dict[int, Track]:
    """The same tracks, each with its own stretch of tape unless the building is straight.

    Straight are alleys of which each is a floor, with lifts at ends, on all floors at one position, and spurs of one
    segment: there a drive's word whether it is turned tells the rest.
    """
    if all(_is_straight(track, tracks) for track in tracks.values()):
        return tracks
    found, next_mm = {}, 0
    for number, track in tracks.items():
        if track.kind is TrackKind.LIFT:
            found[number] = track
            continue
        found[number] = replace(track, origin_mm=next_mm + _TAPE_GAP // 2 * track.pitch_mm)
        next_mm += (track.length + _TAPE_GAP) * track.pitch_mm
    return found


def _is_straight(track: Track, tracks: dict[int, Track]) -> bool:
    if track.kind is TrackKind.SPUR:
        mouths = [one.low for one in tracks.values() if one.kind is TrackKind.SPUR]
        at = tracks.get(track.low.track) if track.low is not None else None
        is_off_alley = at is not None and at.kind is TrackKind.ALLEY
        return is_off_alley and track.length == 1 and track.high is None and mouths.count(track.low) == 1
    if track.kind is TrackKind.LIFT:
        # One position of the tape is that of the platform on all floors.
        places = {0 if at.index == 1 else at.index + 1 for at in track.joins}
        return len(places) == 1 and len(set(track.heights_mm)) == len(track.heights_mm)
    return not (track.ends or track.level or track.one_way)


def _crosswise(tracks: dict[int, Track]) -> Iterator[int]:
    """Each quarter turn away from a track that goes off from no other, else from the first that hang together.

    Lifts do not turn what they carry.
    """
    ways: dict[int, list[tuple[int, bool]]] = {number: [] for number in tracks}
    for track in tracks.values():
        is_lift = track.kind is TrackKind.LIFT
        for mouth in track.joins if is_lift else [mouth for _, mouth in track.ends]:
            if mouth.track in ways:
                ways[track.number].append((mouth.track, not is_lift))
                ways[mouth.track].append((track.number, not is_lift))
    seen: set[int] = set()
    for first in sorted(tracks, key=lambda number: (len(tracks[number].ends), number)):
        ahead = [(first, False)]
        while ahead:
            here, is_across = ahead.pop()
            if here not in seen:
                seen.add(here)
                if is_across:
                    yield here
                ahead += [(there, is_across is not turns) for there, turns in ways[here]]


@singledispatch
def way_site(site: Site) -> WaySite:
    """The same site with its tracks; one whose machines do not move along any has none."""
    return WaySite(**{one.name: getattr(site, one.name) for one in fields(Site)})


@way_site.register
def _(site: WaySite) -> WaySite:
    return site

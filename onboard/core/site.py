"""The site: what all machines of a fleet agree on, as plain values.

Read from a TOML file by ``onboard.config``. Words: a *track* is a line of *segments* (an alley, a lift shaft, a spur);
``Segment(track, index)`` is one body slot of it, written p(k,i) on the alley of floor k (row P31). A *station* is where
a car can stand: a place or a compartment, on one side of a segment.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import ClassVar, NamedTuple

from onboard.core.codes import KindCode, Side


class Segment(NamedTuple):
    """One body slot: index 1 to n on a track; the number on the wire is ``track << 8 | index``."""

    track: int
    index: int  # type: ignore[assignment]  # the position number hides tuple.index on purpose

    @property
    def number(self) -> int:
        """16-bit number on the wire."""
        return self.track << 8 | self.index

    def __str__(self) -> str:
        return f"p({self.track},{self.index})"


class Station(NamedTuple):
    """A place or compartment beside a segment: 16-bit number ``track << 8 | side << 7 | index``, index 1 to 127."""

    track: int
    index: int  # type: ignore[assignment]  # the position number hides tuple.index on purpose
    side: Side

    @property
    def number(self) -> int:
        """16-bit number on the wire."""
        return self.track << 8 | self.side << 7 | self.index

    @property
    def segment(self) -> Segment:
        """The segment in front of it."""
        return Segment(self.track, self.index)

    @classmethod
    def from_number(cls, number: int) -> "Station":
        """Inverse of ``number``, for 0 to 0xFFFE."""
        return cls(number >> 8, number & 0x7F, Side(number >> 7 & 1))

    def __str__(self) -> str:
        return f"p({self.track},{self.index}){'NF'[self.side]}"


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


@dataclass(frozen=True, slots=True)
class Machine:
    """One machine of the site. ``home`` is where a robot or lift stands at first, or the compartment's segment."""

    node_id: int
    name: str
    kind: KindCode
    home: Segment
    station: Station | None = None


@dataclass(frozen=True, slots=True)
class Timing:
    """Protocol and device times of a site, in microseconds unless named otherwise."""

    call_window_us: int
    bid_delay_us: int
    bid_half_us: int
    deadline_guard_us: int
    max_attempts: int
    award_repeat_us: int
    token_repeat_us: int
    heartbeat_us: int
    bus_time_us: int
    door_us: int
    grip_us: int
    drive_refresh_us: int
    #: Share of the time left for a bid that its sub-calls may take, per cent.
    sub_call_percent: int = 50


#: A site without machines that move along tracks: nobody reads it.
_NO_AXIS = Axis(1, 1)


class Needs(Enum):
    """What an order by which something moves needs beside a machine that stands in nobody's way."""

    RIGHT = "each needs a right: what it moves in is shared with others"
    PLACE = "some need a right, by where they move: there is open ground, or a part that nobody else comes to"
    ALONE = "none: it moves within the machine only"


@dataclass(frozen=True, kw_only=True)
class Site:
    """Everything a machine knows beforehand, of any system. Built and checked by ``onboard.config``; frozen thereafter.

    ``stewards`` maps each track number to the node-ID of the fixed machine that holds its segments', places' and stored
    cars' tokens at first. ``digest`` is 16 bits over what the site is (docs/site-file.md): two files that mean the same
    have the same. A system whose machines do not move along tracks has none, nor what follows; it adds its own in a
    class of its own.
    """

    #: Which system this is, as the site file says it; it chooses the kinds' behaviours.
    system: ClassVar[str] = ""
    #: Whether rights can be made anew one by one: only where it is known whose each right is, and what stands where.
    has_regeneration: ClassVar[bool] = False
    #: Why a person cannot hold one machine by itself; empty where that can be.
    no_hold: ClassVar[str] = ""
    #: Names of the fields that say what comes to the site in a run of the simulator. No machine knows them, so they are
    #: not in the digest.
    demand: ClassVar[frozenset[str]] = frozenset()
    #: The messages of the device bus by which something moves: no other does, and these only as ``authorised`` lets.
    moved_by: ClassVar[Mapping[str, Needs]] = {}

    name: str
    digest: int
    bitrate: int
    machines: dict[int, Machine]
    timing: Timing
    stewards: dict[int, int] = field(default_factory=dict)
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
    #: IANA name of the site's local time, for people who look at it; empty where the file has none. Not in the digest.
    time_zone: str = ""

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

    def machine(self, name: str) -> Machine:
        """The machine so named. Raises ``KeyError`` where there is none."""
        for machine in self.machines.values():
            if machine.name == name:
                return machine
        raise KeyError(name)

    def position_mm(self, segment: Segment) -> int:
        """Centre of a segment along its track, in mm from that of index 1."""
        return (segment.index - 1) * self.tracks[segment.track].pitch_mm


def journal_owner(site: Site, machine: Machine) -> str:
    """Whose journal a machine's is: another board with the same machine file may go on with it, nobody else."""
    return f"{site.name} node {machine.node_id}"

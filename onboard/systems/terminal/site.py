"""The container terminal as its machines know it beforehand (rows M01 to M05): a network of entities, boxes, times.

An *entity* is a lane, a crossing, an area or a station. Its number, 1 to 254, is the track of its body slots' tokens:
slot 1 is where a lane is entered, the last one where it is left. A box is named by the desk that has it in its books.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import ClassVar, NamedTuple

from onboard.contract.codes import KindCode
from onboard.contract.messages import Reference
from onboard.core.site import MotionNeeds, Site


class EntityKind(Enum):
    """What an entity of the network is (row M01)."""

    LANE = "lane"
    CROSSING = "crossing"
    AREA = "area"
    STATION = "station"


class StationKind(Enum):
    """How boxes stand at a station (row M02): one on another, of which only the uppermost can be had, or in slots."""

    STACK = "stack"
    STACKER = "stacker"


@dataclass(frozen=True, slots=True)
class Entity:
    """One place of the network. ``duration_us`` is what a robot alone takes to cross it (row M14).

    ``turns`` are other durations for single ways through it, by (from, to). ``capacity`` is how many robots may be in
    it at once, 0 for any number; ``leads_to`` are the entities that it is left for. A station is in its ``area``.
    """

    number: int
    name: str
    kind: EntityKind
    duration_us: int
    capacity: int
    leads_to: tuple[int, ...] = ()
    length_mm: int = 0
    area: int = 0
    station: StationKind | None = None
    room: int = 0
    turns: tuple[tuple[int, int, int], ...] = ()

    def crossing_us(self, before: int, after: int) -> int:
        """What crossing it takes on the way from one entity to another."""
        return next((us for one, other, us in self.turns if (one, other) == (before, after)), self.duration_us)


class Box(NamedTuple):
    """A container: its type and the station where it is at first. Boxes of a stack are listed from the ground up."""

    name: str
    type: str
    station: int


@dataclass(frozen=True, slots=True)
class Mission:
    """What an operator orders at a desk (rows M04 to M06): ``count`` of ``type`` from ``source``, or named ``boxes``.

    ``before_us`` is the bus time by which each must be put down, 0 for any; ``urgent`` ones go first.
    """

    at_us: int
    desk: int
    target: int
    count: int = 0
    type: str = ""
    source: int = 0
    boxes: tuple[int, ...] = ()
    before_us: int = 0
    urgent: bool = False


@dataclass(frozen=True, slots=True)
class Blockage:
    """An obstacle that lies on a lane for a time (row M03): part of a demonstration, not known to any machine."""

    lane: int
    at_us: int
    until_us: int


@dataclass(frozen=True, slots=True)
class Press:
    """What a person does to a vehicle by hand after ``at_us`` (row M38): "hold", "step" or "release"."""

    at_us: int
    vehicle: int
    what: str


@dataclass(frozen=True, kw_only=True)
class Terminal(Site):
    """A terminal. Durations in us; ``gap_us`` is the one tick that the paper's ``>`` on integers is between robots.

    ``horizon_us`` is the paper's delta T (row M24), ``patience_us`` how long a blocked lane is waited for before plans
    are made anew (row M33). ``boxes`` are numbered from 1 in their order; the first desk has them in its books.
    """

    system: ClassVar[str] = "terminal"
    called: ClassVar[str] = "container terminal"
    demand: ClassVar[frozenset[str]] = frozenset({"missions", "blockages", "presses"})
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {"MoveOrder": MotionNeeds.PLACE, "HandlerOrder": MotionNeeds.RIGHT}

    entities: Mapping[int, Entity] = field(default_factory=dict)
    boxes: tuple[Box, ...] = ()
    missions: tuple[Mission, ...] = ()
    blockages: tuple[Blockage, ...] = ()
    presses: tuple[Press, ...] = ()
    dock_us: int = 2_000_000
    handle_us: int = 2_000_000
    undock_us: int = 2_000_000
    gap_us: int = 1_000_000
    horizon_us: int = 60_000_000
    patience_us: int = 30_000_000
    routes: int = 3

    @cached_property
    def desk(self) -> int:
        """Node-ID of the desk that has the boxes in its books: the lowest."""
        return min(node for node, machine in self.machines.items() if machine.kind is KindCode.DESK)

    @cached_property
    def vehicles(self) -> tuple[int, ...]:
        """Node-IDs of all vehicles, in order; the place in it is a vehicle's own bay in every area."""
        return tuple(sorted(node for node, one in self.machines.items() if one.kind is KindCode.VEHICLE))

    @cached_property
    def by_name(self) -> dict[str, Entity]:
        """All entities by the names of the site file."""
        return {entity.name: entity for entity in self.entities.values()}

    def box(self, number: int) -> Reference:
        """The name of a box on the bus."""
        return Reference(self.desk, number)

    def stations_in(self, place: int) -> tuple[int, ...]:
        """Stations of an area; a station is its own."""
        if self.entities[place].kind is EntityKind.STATION:
            return (place,)
        return tuple(one.number for one in self.entities.values() if one.area == place)

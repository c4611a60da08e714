"""What the machines of a pick-up and delivery site know beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from onboard.contract.codes import KindCode
from onboard.core.site import MotionNeeds, Site
from onboard.systems.mapd.floor import FREE, Floor, NetworkLine, grid_floor, network_floor
from onboard.systems.mapd.prospects import Prospects
from onboard.systems.mapd.rights import cell_station
from onboard.systems.mapd.tasks import TransportTask
from onboard.ways.rests import lasting_rests

__all__ = [
    "FREE",
    "Floor",
    "Mapd",
    "NetworkLine",
    "TransportTask",
    "cell_station",
    "grid_floor",
    "network_floor",
]


@dataclass(frozen=True, kw_only=True)
class Mapd(Site):
    """A floor, given by ``rows`` of a map or by ``points``, ``lines`` and ``zones``; robots, endpoints and tasks.

    ``homes`` maps each robot's node-ID to its cell; ``endpoints`` are cells where tasks begin and end; ``step_ms`` is
    how long a step takes. ``tasks`` are what a run of the site asks for, numbered from 0.
    """

    system: ClassVar[str] = "mapd"
    called: ClassVar[str] = "floor of pick-up and delivery"
    demand: ClassVar[frozenset[str]] = frozenset({"tasks"})
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {"CartOrder": MotionNeeds.RIGHT}
    no_hold: ClassVar[str] = "these robots move in step, and one that is held would hold all"

    rows: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    lines: tuple[NetworkLine, ...] = ()
    zones: tuple[tuple[str, ...], ...] = ()
    homes: dict[int, int]
    endpoints: tuple[int, ...]
    tasks: tuple[TransportTask, ...]
    step_ms: int

    @cached_property
    def floor(self) -> Floor:
        """The cells and the ways between them."""
        return grid_floor(self.rows) if self.rows else network_floor(self.points, self.lines, self.zones)

    @cached_property
    def rests(self) -> frozenset[int]:
        """Where robots may stand for ever: homes first, then endpoints, as many as shut nobody in."""
        return lasting_rests(self.floor.network, [*self.homes.values(), *self.endpoints], self.endpoints)

    @cached_property
    def prospects(self) -> Prospects:
        """What is open, for the bids of all robots."""
        return Prospects(self.floor, len(self.robots))

    @property
    def step_us(self) -> int:
        """How long a step takes at least, in us."""
        return self.step_ms * 1000

    @property
    def bid_window_us(self) -> int:
        """How long bids for a step may come, in us: two fifths of it; the rest is for awards, rights and the move."""
        return self.step_us * 2 // 5

    @property
    def travel_us(self) -> int:
        """How long a body takes to the next cell, in us: half a step, so that a late start still ends in time."""
        return self.step_us // 2

    @cached_property
    def desk(self) -> int:
        """Node-ID of the order desk."""
        return min(node for node, one in self.machines.items() if one.kind is KindCode.DESK)

    @cached_property
    def robots(self) -> tuple[int, ...]:
        """Node-IDs of the robots, lowest first."""
        return tuple(node for node, one in sorted(self.machines.items()) if one.kind is KindCode.VEHICLE)

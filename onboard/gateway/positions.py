"""Where each mobile machine is and what lies ahead of it, as the fleet bus of its system tells it.

VDA 5050 knows nodes by name and positions on maps. Where machines move along tracks a node is a segment ``p(k,i)``, and
a map is one track, x along it in metres from index 1; other systems say in their folders what their nodes are. Where a
site file has no coordinates there is no position.
"""

from dataclasses import dataclass
from math import pi
from typing import Protocol

from onboard.contract.codes import LegAction
from onboard.contract.messages import Message
from onboard.core.site import Segment, Site
from onboard.history.history import Fact, History
from onboard.history.places import PlaceTold
from onboard.history.plans import PlanTold
from onboard.ways.site import TrackKind, way_site


@dataclass(frozen=True, slots=True)
class MachinePosition:
    """One machine. ``ahead`` are the nodes still to come, in turn; ``passed`` counts nodes left behind.

    ``x_m`` and ``theta`` (rad) are on map ``map_id``, None where the site has no coordinates. ``away_m`` is the way
    from ``node``, 0 where unknown. ``speed_m_s`` is along the track with its sign.
    """

    node: str
    ahead: tuple[str, ...] = ()
    passed: int = 0
    driving: bool = False
    map_id: str | None = None
    x_m: float = 0.0
    theta: float = 0.0
    away_m: float = 0.0
    speed_m_s: float = 0.0


class Tracker(Protocol):
    """A view of a history: where machines are."""

    def take(self, message: Message, fact: Fact | None) -> bool:
        """Take up one message, and what it told; whether the sender's position may have changed."""

    def where(self, node_id: int) -> MachinePosition:
        """What is known of a mobile machine of the site."""


class TrackTracker:
    """Machines that move along the tracks of a site."""

    def __init__(self, site: Site, history: History) -> None:
        self._ways = way_site(site)
        self._history = history

    def take(self, message: Message, fact: Fact | None) -> bool:
        """True where a machine's place or way is told."""
        return isinstance(fact, PlaceTold) or (isinstance(fact, PlanTold) and fact.is_firm)

    def where(self, node_id: int) -> MachinePosition:
        """The segment where the machine is, and those of its plan that lie ahead."""
        place = self._history.places.by_node[node_id]
        segment, node = place.segment, str(place.segment)
        ahead: list[str] = []
        for leg in self._history.plans.ahead(node_id):
            then = str(Segment(leg.track, leg.to_index))
            if leg.action in (LegAction.TRAVEL, LegAction.RIDE) and then != (ahead[-1] if ahead else node):
                ahead.append(then)
        track = self._ways.tracks.get(segment.track)
        if track is None:
            return MachinePosition(node, tuple(ahead), place.passed, place.speed_mm_s != 0)
        return MachinePosition(
            node,
            tuple(ahead),
            place.passed,
            place.speed_mm_s != 0,
            map_of(track.kind, track.number),
            (self._ways.position_mm(segment) + place.offset_mm) / 1000,
            pi / 2 if track.kind is TrackKind.SPUR else 0.0,
            abs(place.offset_mm) / 1000,
            place.speed_mm_s / 1000,
        )


def map_of(kind: TrackKind, number: int) -> str:
    """The map of one track: ``floor-3``, ``lift-128``, ``spur-192``."""
    return f"{'floor' if kind is TrackKind.ALLEY else kind.value}-{number}"

"""Where each mobile machine is and what lies ahead of it, as the fleet bus of its system tells it.

VDA 5050 knows nodes by name and positions on maps. Where machines move along tracks a node is a segment ``p(k,i)``, and
a map is one track, x along it in metres from index 1; other systems say in their folders what their nodes are. Where a
site file has no coordinates there is no position.
"""

from dataclasses import dataclass, replace
from math import pi
from typing import Protocol

from onboard.contract.codes import Grade, LegAction
from onboard.contract.messages import Itinerary, Message, Progress
from onboard.core.site import Segment, Site
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
    """A fold over the fleet bus."""

    def feed(self, message: Message) -> bool:
        """Take up one message; whether the sender's position may have changed."""

    def where(self, node_id: int) -> MachinePosition:
        """What is known of a mobile machine of the site."""


class TrackTracker:
    """Machines that move along the tracks of a site."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._at: dict[int, MachinePosition] = {}
        self._plans: dict[int, Itinerary] = {}
        self._legs: dict[int, int] = {}
        for machine in site.machines.values():
            self._at[machine.node_id] = self._place(machine.home, 0, 0, 0)

    def feed(self, message: Message) -> bool:
        """Follow progress and firm plans; True where a machine's place or way has changed."""
        match message:
            case Progress():
                old = self._at.get(message.sender)
                if old is None:
                    return False
                segment = Segment(message.track, message.index)
                passed = old.passed + (old.node != str(segment))
                self._at[message.sender] = self._place(segment, message.offset_mm, message.speed_mm_s, passed)
                plan = self._plans.get(message.sender)
                if plan is not None and plan.version == message.itinerary_version:
                    self._legs[message.sender] = message.leg
                return True
            case Itinerary() if message.grade is Grade.FIRM:
                self._plans[message.sender] = message
                self._legs[message.sender] = 0
                return True
        return False

    def where(self, node_id: int) -> MachinePosition:
        """The segment where the machine is, and those of its plan that lie ahead."""
        at, plan = self._at[node_id], self._plans.get(node_id)
        if plan is None:
            return at
        ahead: list[str] = []
        for leg in plan.legs[self._legs[node_id] :]:
            node = str(Segment(leg.track, leg.to_index))
            if leg.action in (LegAction.TRAVEL, LegAction.RIDE) and node != (ahead[-1] if ahead else at.node):
                ahead.append(node)
        return replace(at, ahead=tuple(ahead))

    def _place(self, segment: Segment, offset_mm: int, speed_mm_s: int, passed: int) -> MachinePosition:
        track = way_site(self._site).tracks.get(segment.track)
        node, driving = str(segment), speed_mm_s != 0
        if track is None:
            return MachinePosition(node, (), passed, driving)
        return MachinePosition(
            node,
            (),
            passed,
            driving,
            map_of(track.kind, track.number),
            (way_site(self._site).position_mm(segment) + offset_mm) / 1000,
            pi / 2 if track.kind is TrackKind.SPUR else 0.0,
            abs(offset_mm) / 1000,
            speed_mm_s / 1000,
        )


def map_of(kind: TrackKind, number: int) -> str:
    """The map of one track: ``floor-3``, ``lift-128``, ``spur-192``."""
    return f"{'floor' if kind is TrackKind.ALLEY else kind.value}-{number}"

"""Where each mobile machine is and what lies ahead of it, as the fleet bus of its system tells it.

VDA 5050 knows nodes by name and positions on maps. A node is a segment ``p(k,i)`` of a car park, a node of a factory
graph by its number, an entity of a terminal by its name. A map is one track, x along it in metres from index 1; where
a site file has no coordinates there is no position.
"""

from dataclasses import dataclass, replace
from math import pi
from typing import Protocol

from onboard.core.codes import Grade, LegAction
from onboard.core.messages import Itinerary, Message, Progress
from onboard.core.site import Segment, Site
from onboard.systems.graph.messages import RobotAt
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.terminal.messages import PlanHead, PlanStep, StepReport, StepResult
from onboard.systems.terminal.site import Terminal
from onboard.ways.site import TrackKind, way_site

#: A graph's robot that has nowhere to go says so with this (onboard/systems/graph/messages.NO_NODE).
_NO_NODE = 255


@dataclass(frozen=True, slots=True)
class Whereabouts:
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
        """Take up one message; whether the sender's whereabouts may have changed."""

    def where(self, node_id: int) -> Whereabouts:
        """What is known of a mobile machine of the site."""


def tracker_of(site: Site) -> Tracker:
    """The tracker of a site's system."""
    if isinstance(site, FactoryGraph):
        return GraphTracker(site)
    if isinstance(site, Terminal):
        return EntityTracker(site)
    return TrackTracker(site)


class TrackTracker:
    """Machines that move along tracks: the car park."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._at: dict[int, Whereabouts] = {}
        self._plans: dict[int, Itinerary] = {}
        self._legs: dict[int, int] = {}
        for machine in site.machines.values():
            self._at[machine.node_id] = self._place(machine.home, 0, 0, 0)

    def feed(self, message: Message) -> bool:
        """Progress and firm plans."""
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

    def where(self, node_id: int) -> Whereabouts:
        """As in the port."""
        at, plan = self._at[node_id], self._plans.get(node_id)
        if plan is None:
            return at
        ahead: list[str] = []
        for leg in plan.legs[self._legs[node_id] :]:
            node = str(Segment(leg.track, leg.to_index))
            if leg.action in (LegAction.TRAVEL, LegAction.RIDE) and node != (ahead[-1] if ahead else at.node):
                ahead.append(node)
        return replace(at, ahead=tuple(ahead))

    def _place(self, segment: Segment, offset_mm: int, speed_mm_s: int, passed: int) -> Whereabouts:
        track = way_site(self._site).tracks.get(segment.track)
        node, driving = str(segment), speed_mm_s != 0
        if track is None:
            return Whereabouts(node, (), passed, driving)
        return Whereabouts(
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


class GraphTracker:
    """Robots of a factory graph: nodes by number, no coordinates."""

    def __init__(self, site: FactoryGraph) -> None:
        self._at = {node: Whereabouts(str(machine.home.track)) for node, machine in site.robots.items()}

    def feed(self, message: Message) -> bool:
        """Robots say where they are and where they go."""
        if not isinstance(message, RobotAt) or message.sender not in self._at:
            return False
        old = self._at[message.sender]
        node = str(message.behind if message.on_edge else message.node)
        first = (message.node,) if message.on_edge else ()
        coming = (*first, message.ahead1, message.ahead2, message.ahead3, message.goal)
        ahead: list[str] = []
        for one in coming:
            if one != _NO_NODE and str(one) != (ahead[-1] if ahead else node):
                ahead.append(str(one))
        self._at[message.sender] = Whereabouts(node, tuple(ahead), old.passed + (node != old.node), message.on_edge)
        return True

    def where(self, node_id: int) -> Whereabouts:
        """As in the port."""
        return self._at[node_id]


@dataclass(slots=True)
class _Plan:
    """A vehicle's plan as far as it was heard, by step."""

    version: int
    steps: int
    entities: dict[int, int]
    done: int = 0


class EntityTracker:
    """Vehicles of a terminal: entities by name, no coordinates."""

    def __init__(self, site: Terminal) -> None:
        self._site = site
        self._at = {node: Whereabouts(self._name(site.machines[node].home.track)) for node in site.vehicles}
        self._plans: dict[int, _Plan] = {}

    def feed(self, message: Message) -> bool:
        """Plans and the steps done of them."""
        if message.sender not in self._at:
            return False
        plan = self._plans.get(message.sender)
        match message:
            case PlanHead() if plan is None or message.version != plan.version:
                self._plans[message.sender] = _Plan(message.version, message.steps, {})
            case PlanStep() if plan is not None and plan.version == message.version:
                plan.entities[message.step] = message.entity
            case StepReport() if plan is not None and plan.version == message.version:
                self._on_report(message, plan)
            case _:
                return False
        return True

    def _on_report(self, report: StepReport, plan: _Plan) -> None:
        if report.result is not StepResult.DONE:
            self._at[report.sender] = replace(self._at[report.sender], driving=False)
            return
        plan.done = max(plan.done, report.step + 1)
        node, old = self._name(plan.entities.get(plan.done, report.entity)), self._at[report.sender]
        self._at[report.sender] = Whereabouts(node, (), old.passed + (node != old.node), plan.done < plan.steps)

    def where(self, node_id: int) -> Whereabouts:
        """As in the port."""
        at, plan = self._at[node_id], self._plans.get(node_id)
        if plan is None or len(plan.entities) < plan.steps:
            return at
        ahead: list[str] = []
        for step in range(plan.done, plan.steps):
            name = self._name(plan.entities[step])
            if name != (ahead[-1] if ahead else at.node):
                ahead.append(name)
        return replace(at, ahead=tuple(ahead))

    def _name(self, number: int) -> str:
        entity = self._site.entities.get(number)
        return entity.name if entity is not None else str(number)

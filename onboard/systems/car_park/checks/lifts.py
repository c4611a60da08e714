"""Lifts: they move only with their gate, never while something is over the sill, and nobody steps into an empty shaft.

``LiftCrush`` carries the name of what a verified model of an automated garage once found possible: a lift crushing what
overhangs its sill.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence

from onboard.contract.codes import DriveMode, KindCode
from onboard.contract.messages import DriveOrder, DriveState, Message, PlatformState, Progress
from onboard.core.site import Segment
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.geometry import (
    GATE_INDEX,
    ReportedPosition,
    floors_of,
    lifts_under,
    occupied,
    sent_through,
    token_of,
)
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule


class _LiftRule(Rule):
    """Sees a lift move: by its ``Progress``, by its drive's state, and by the orders that its drive is given."""

    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        machines = picture.site.machines.items()
        self._tracks = {node: machine.home.track for node, machine in machines if machine.kind is KindCode.LIFT}

    def handlers(self) -> Handlers:
        """Where lifts are, and with device buses what their drives do and are told."""
        return {Progress: self._on_progress, DriveState: self._on_state, DriveOrder: self._on_order}

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        track = self._tracks.get(event.message.sender)
        body = self.picture.body_told(event.message, event.time_us) if track is not None else None
        if track is None or body is None:
            return
        before = self.picture.bodies.get(body.node)
        if body.speed_mm_s or (before is not None and before.position_mm != body.position_mm):
            self._moves(event, track, body.node, "moves")

    def _on_state(self, event: LogEvent[DriveState]) -> None:
        track = self._tracks.get(event.message.sender)
        if track is not None and event.message.mode is DriveMode.MOVING and event.message.speed_mm_s:
            self._moves(event, track, event.message.sender, "moves")

    def _on_order(self, event: LogEvent[DriveOrder]) -> None:
        track = self._tracks.get(event.message.sender)
        if track is not None:
            self._moves(event, track, event.message.sender, "is sent")

    @abstractmethod
    def _moves(self, event: LogEvent[Message], track: int, node: int, how: str) -> None:
        """A lift moves, or is about to."""


class LiftByGate(_LiftRule):
    """A lift moves only while it holds its own gate."""

    name = "lift-by-gate"
    title = "a lift moves only with its gate"
    source = "docs/decisions.md, A lift's platform and its gate are two tokens"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._told: set[int] = set()

    def _moves(self, event: LogEvent[Message], track: int, node: int, how: str) -> None:
        gate = token_of(Segment(track, GATE_INDEX))
        holder = self.picture.tokens.holder(gate)
        self.picture.unjudged += holder is None
        if self.picture.tokens.may_use(gate, node, event.time_us):
            self._told.discard(node)
        elif node not in self._told:
            self._told.add(node)
            self.find(event, (node, holder or 0), f"{how} while {holder} holds its gate")


class LiftCrush(_LiftRule):
    """A lift crushing what overhangs its sill: it moves while a body is over it, by its curtain or the bodies' word."""

    name = "lift-crush"
    title = "a lift crushing what overhangs its sill"
    source = "issue 4, point 1: found possible in a verified garage model"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._crossing: set[int] = set()
        self._told: set[int] = set()

    def handlers(self) -> Handlers:
        """Beside the lifts' motions, what their curtains see."""
        return {**super().handlers(), PlatformState: self._on_platform}

    def _on_platform(self, event: LogEvent[PlatformState]) -> None:
        (self._crossing.add if event.message.crossing else self._crossing.discard)(event.message.sender)

    def _moves(self, event: LogEvent[Message], track: int, node: int, how: str) -> None:
        ways, gate = self.picture.ways, Segment(track, GATE_INDEX)
        over = [
            body.node for body in self._robots() if gate in occupied(ways, body) and track in lifts_under(ways, body)
        ]
        if not over and node not in self._crossing:
            self._told.discard(node)
        elif node not in self._told:
            self._told.add(node)
            who = "its curtain sees a body" if node in self._crossing else f"{over[0]} is"
            self.find(event, (node, *over), f"{how} while {who} over its sill")

    def _robots(self) -> list[ReportedPosition]:
        return [body for body in self.picture.bodies.values() if self.picture.kind(body.node) is KindCode.ROBOT]


class PlatformThere(Rule):
    """Nobody crosses a sill while the lift is elsewhere or moves."""

    name = "platform-there"
    title = "nobody goes into an empty shaft"
    source = "docs/decisions.md, A lift's platform and its gate are two tokens"
    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._told: set[int] = set()

    def handlers(self) -> Handlers:
        """Where robots are, and with device buses where they are sent."""
        return {Progress: self._on_progress, DriveOrder: self._on_order}

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        body = self.picture.body_told(event.message, event.time_us)
        if body is not None and self.picture.kind(body.node) is KindCode.ROBOT:
            self._judge(event, body, occupied(self.picture.ways, body), "is over")

    def _on_order(self, event: LogEvent[DriveOrder]) -> None:
        body = self.picture.bodies.get(event.message.sender)
        if body is None or self.picture.kind(body.node) is not KindCode.ROBOT:
            return
        site, body = self.picture.site, self.picture.on_floor(body)
        # Its last Progress may be of before it came off the sill: the next one is due at the border of a segment.
        slots = sent_through(site, self.picture.sensed(body) or body, event.message)
        self._judge(event, body, slots, "is sent over")

    def _judge(self, event: LogEvent[Message], body: ReportedPosition, slots: Sequence[Segment], how: str) -> None:
        site, wrong = self.picture.ways, False
        for slot in slots:
            lift = self.picture.bodies.get(site.stewards.get(slot.track, 0)) if slot.index == GATE_INDEX else None
            if lift is None or lift.track != slot.track:
                continue
            # By floors: an order may lead through one lift to another, and so to a door of another alley.
            level = site.level(body.track)
            there = {site.level(track) for track in floors_of(site, lift)}
            if lift.speed_mm_s or level not in there:
                wrong = True
                where = "moves" if lift.speed_mm_s else f"is at floor {min(there)}"
                if body.node not in self._told:
                    what = f"{how} the sill of floor {level} while the lift {where}"
                    self.find(event, (body.node, lift.node), what)
        (self._told.add if wrong else self._told.discard)(body.node)

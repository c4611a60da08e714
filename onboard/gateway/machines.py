"""What the fleet bus tells of each mobile machine, folded for one VDA 5050 state a machine."""

from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, KindCode, MachineState, ManualMode, Reason, TaskPhase
from onboard.contract.constants import ANY_STATION, MOBILE_KINDS
from onboard.contract.messages import (
    Blocked,
    CarAt,
    Clear,
    EmergencyStop,
    Halted,
    Heartbeat,
    Itinerary,
    ManualState,
    Message,
    Reference,
    TaskReport,
    Waiting,
)
from onboard.core.site import Machine, Segment, Site
from onboard.gateway.edge import edge_of
from onboard.gateway.positions import MachinePosition, Tracker
from onboard.history.calls import CallAnswered
from onboard.history.history import Fact

#: Three heartbeats missed, a machine counts as silent: as the machines themselves count (onboard/holon/presence.py).
SILENT_BEATS = 3
#: An arm stands where it is bolted down: it is no machine that VDA 5050 speaks of.
TRAVELLERS = MOBILE_KINDS - {KindCode.ARM}
#: Blocked segments that are told of; more than so many are one too many for a person as well.
MOST_BLOCKED = 32
_OVER = (TaskPhase.DONE, TaskPhase.REFUSED, TaskPhase.FORFEITED)


@dataclass(slots=True)
class TaskInHand:
    """A machine's newest task. ``updates`` counts plans told for it; ``began`` nodes were passed before it."""

    task: Reference
    phase: TaskPhase
    reason: Reason = Reason.NONE
    updates: int = 0
    began: int = 0

    @property
    def is_over(self) -> bool:
        """Whether nothing more is done for it."""
        return self.phase in _OVER


@dataclass(slots=True)
class MobileMachine:
    """What is known of one mobile machine: when it was heard (loop time, us), its state, task and load."""

    machine: Machine
    heard_us: int | None = None
    state: MachineState | None = None
    task: TaskInHand | None = None
    load: Reference | None = None
    wait: Waiting | None = None
    wait_us: int = 0
    is_held: bool = False
    #: By its own word: held, and come to rest.
    is_paused: bool = False
    #: Why it does not act, by its own word or another's, and when that was said last.
    halted: Halted | None = None
    halted_us: int = 0


@dataclass
class Machines:
    """A fold: feed every message of the fleet bus in order. ``changed`` are node-IDs whose state may be another."""

    site: Site
    bodies: dict[int, MobileMachine] = field(init=False)
    blocked: dict[Segment, Blocked] = field(default_factory=dict)
    emergency: EmergencyStop | None = None
    changed: set[int] = field(default_factory=set)
    #: Machines that said where they are since this was last emptied.
    moved: set[int] = field(default_factory=set)
    _tracker: Tracker = field(init=False)

    def __post_init__(self) -> None:
        mobile = sorted(node for node, one in self.site.machines.items() if one.kind in TRAVELLERS)
        self.bodies = {node: MobileMachine(self.site.machines[node]) for node in mobile}
        self._tracker = edge_of(self.site).tracker()

    def where(self, node_id: int) -> MachinePosition:
        """Where a mobile machine is."""
        return self._tracker.where(node_id)

    def feed(self, message: Message, now_us: int, fact: Fact | None = None) -> None:
        """Take up one message, and what the history made of it."""
        self._on_site(message)
        body = self.bodies.get(message.sender)
        if body is not None:
            body.heard_us = now_us
        if self._tracker.feed(message) and body is not None:
            self.changed.add(message.sender)
            self.moved.add(message.sender)
            if self.where(message.sender).driving:
                body.wait = None
        if body is not None:
            self._on_word(body, message, now_us)
        if isinstance(fact, CallAnswered) and fact.award.result is CallResult.WITHDRAWN:
            self._on_withdrawal(fact)
        match message:
            case CarAt():
                self._on_car(message)
            case Halted():
                self._on_halted(message, now_us)

    def halted(self, node_id: int, now_us: int) -> Halted | None:
        """Why a machine does not act, as long as that is said, in each heartbeat period."""
        body = self.bodies[node_id]
        is_said = now_us - body.halted_us <= SILENT_BEATS * self.site.timing.heartbeat_us
        return body.halted if is_said else None

    def _on_halted(self, word: Halted, now_us: int) -> None:
        body = self.bodies.get(word.machine)
        is_false = word.reason is Reason.FALSE_STATEMENT
        if body is None or not (word.sender == word.machine or is_false or self.is_silent(word.machine, now_us)):
            return
        before = self.halted(word.machine, now_us)
        body.halted, body.halted_us = word, now_us
        if before is None or (before.reason, before.needs_person) != (word.reason, word.needs_person):
            self.changed.add(word.machine)

    def is_silent(self, node_id: int, now_us: int) -> bool:
        """Whether a machine was never heard, or not for three of its heartbeats."""
        return self.bodies[node_id].heard_us is None or now_us >= self.silent_us(node_id)

    def silent_us(self, node_id: int) -> int:
        """When a machine that is not heard again counts as silent, us."""
        return (self.bodies[node_id].heard_us or 0) + SILENT_BEATS * self.site.timing.heartbeat_us + 1

    def _on_word(self, body: MobileMachine, message: Message, now_us: int) -> None:
        """What a mobile machine says of itself."""
        match message:
            case Heartbeat():
                self._on_heartbeat(body, message)
            case TaskReport():
                self._on_report(body, message)
            case Waiting():
                body.wait, body.wait_us = message, now_us
                self.changed.add(message.sender)
            case ManualState():
                was_held, body.is_held = body.is_held, message.manual_mode is not ManualMode.AUTOMATIC
                # It stood in the way because it was held; what it is now, its next heartbeat says.
                body.state = body.state if body.is_held or not was_held else None
                body.is_paused = body.is_held and message.at_rest
                self.changed.add(message.sender)
            case Itinerary() if body.task is not None:
                body.task.updates += 1

    def _on_site(self, message: Message) -> None:
        """What concerns all machines."""
        match message:
            case Blocked() if len(self.blocked) < MOST_BLOCKED:
                self.blocked[Segment(message.track, message.index)] = message
            case Clear():
                self.blocked.pop(Segment(message.track, message.index), None)
            case EmergencyStop():
                self.emergency = message
            case _:
                return
        self.changed.update(self.bodies)

    def _on_heartbeat(self, body: MobileMachine, message: Heartbeat) -> None:
        if body.state is not message.state:
            body.state = message.state
            self.changed.add(message.sender)
        if message.state in (MachineState.IDLE, MachineState.WORKING):
            # None that stands because it is held says so: its word that it was let go may have been lost.
            body.is_held = body.is_paused = False
            if body.halted is not None and body.halted.sender == message.sender:
                body.halted = None
                self.changed.add(message.sender)
        if message.state in (MachineState.IDLE, MachineState.WORKING) and self.emergency is not None:
            # Whoever is held by an emergency stop says OBSTACLE: one that works was let go, or the stop is old.
            self.emergency = None
            self.changed.update(self.bodies)

    def _on_report(self, body: MobileMachine, report: TaskReport) -> None:
        task = body.task
        if task is None or task.task != report.task:
            if report.phase in _OVER:
                # A statement of what is over, after a restart or on being asked.
                return
            body.task = TaskInHand(report.task, report.phase, report.reason, began=self.where(report.sender).passed)
        elif not task.is_over:
            task.phase, task.reason = report.phase, report.reason
        self.changed.add(report.sender)

    def _on_withdrawal(self, fact: CallAnswered) -> None:
        award = fact.award
        for node, body in self.bodies.items():
            if body.task is not None and body.task.task == award.task and not body.task.is_over:
                body.task.phase, body.task.reason = TaskPhase.FORFEITED, award.reason
                self.changed.add(node)

    def _on_car(self, message: CarAt) -> None:
        for node, body in self.bodies.items():
            aboard = message.station == ANY_STATION and node == message.sender
            if aboard != (body.load == message.car):
                body.load = message.car if aboard else None
                self.changed.add(node)

"""What the history of a fleet bus tells of each mobile machine, for one VDA 5050 state a machine."""

from dataclasses import dataclass, field
from itertools import islice

from onboard.contract.codes import CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import Blocked, Halted, Message, Reference, TaskReport, Waiting
from onboard.core.site import Machine, Segment, Site
from onboard.gateway.edge import edge_of
from onboard.gateway.positions import MachinePosition, Tracker
from onboard.history.batteries import BatteryTold
from onboard.history.calls import CallAnswered
from onboard.history.halts import HaltTold
from onboard.history.hands import HandTold
from onboard.history.history import Fact, History
from onboard.history.lives import SILENT_BEATS, Beat, WaitTold
from onboard.history.loads import LoadTold
from onboard.history.orders import SlotTold, StopTold
from onboard.history.plans import PlanTold
from onboard.history.tasks import TaskTold

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
    """One mobile machine as its history tells it, and its newest task."""

    machine: Machine
    history: History
    task: TaskInHand | None = None

    @property
    def is_heard(self) -> bool:
        """Whether it was ever heard."""
        return self.machine.node_id in self.history.lives.heard_us

    @property
    def state(self) -> MachineState | None:
        """By its last heartbeat. One that was let go since stood in the way because it was held: not known."""
        node = self.machine.node_id
        return None if node in self.history.hands.let_go else self.history.lives.states.get(node)

    @property
    def load(self) -> Reference | None:
        """The load aboard by the newest word of it, None for none."""
        return self.history.loads.aboard.get(self.machine.node_id)

    @property
    def wait(self) -> tuple[int, Waiting] | None:
        """What it waits for, and when it said so, us of the loop."""
        return self.history.lives.waits.get(self.machine.node_id)

    @property
    def is_held(self) -> bool:
        """Whether a person holds it."""
        return self.machine.node_id in self.history.hands.held

    @property
    def is_paused(self) -> bool:
        """By its own word: held, and come to rest."""
        return self.history.hands.is_at_rest(self.machine.node_id)


@dataclass
class Machines:
    """A view of a history. ``changed`` are node-IDs whose state may be another."""

    site: Site
    history: History
    bodies: dict[int, MobileMachine] = field(init=False)
    changed: set[int] = field(default_factory=set)
    #: Machines that said where they are since this was last emptied.
    moved: set[int] = field(default_factory=set)
    _tracker: Tracker = field(init=False)

    def __post_init__(self) -> None:
        mobile = sorted(node for node, one in self.site.machines.items() if one.kind in TRAVELLERS)
        self.bodies = {node: MobileMachine(self.site.machines[node], self.history) for node in mobile}
        self._tracker = edge_of(self.site).tracker(self.history)

    @property
    def blocked(self) -> dict[Segment, Blocked]:
        """Segments that nobody can pass, the first so many."""
        return dict(islice(self.history.orders.blocked.items(), MOST_BLOCKED))

    @property
    def is_stopped(self) -> bool:
        """Whether an emergency stop holds all."""
        return self.history.orders.stop is not None

    def where(self, node_id: int) -> MachinePosition:
        """Where a mobile machine is."""
        return self._tracker.where(node_id)

    def take(self, message: Message, fact: Fact | None, now_us: int) -> None:
        """Take up one message, and what the history made of it."""
        body = self.bodies.get(message.sender)
        if self._tracker.take(message, fact) and body is not None:
            self.changed.add(message.sender)
            self.moved.add(message.sender)
        if body is not None:
            self._on_word(body, fact)
        match fact:
            case Beat(ends_stop=True) | SlotTold() | StopTold():
                self.changed.update(self.bodies)
            case CallAnswered() if fact.award.result is CallResult.WITHDRAWN:
                self._on_withdrawal(fact)
            case LoadTold(changed=changed):
                self.changed |= changed & self.bodies.keys()
            case HaltTold():
                self._on_halt(fact, now_us)

    def halted(self, node_id: int, now_us: int) -> Halted | None:
        """Why a machine does not act, as long as that is said, in each heartbeat period."""
        return self.history.halts.last(node_id, now_us, self._patience_us)

    @property
    def _patience_us(self) -> int:
        return SILENT_BEATS * self.site.timing.heartbeat_us

    def _on_halt(self, told: HaltTold, now_us: int) -> None:
        word = told.word
        told_us, before = told.before or (0, None)
        is_same = before is not None and now_us - told_us <= self._patience_us
        is_same &= before is not None and (before.reason, before.needs_person) == (word.reason, word.needs_person)
        if word.machine in self.bodies and not is_same:
            self.changed.add(word.machine)

    def is_silent(self, node_id: int, now_us: int) -> bool:
        """Whether a machine was never heard, or not for three of its heartbeats."""
        return self.history.lives.is_silent(node_id, now_us)

    def silent_us(self, node_id: int) -> int:
        """When a machine that is not heard again counts as silent, us."""
        return self.history.lives.silent_us(node_id)

    def _on_word(self, body: MobileMachine, fact: Fact | None) -> None:
        """What a mobile machine says of itself."""
        match fact:
            case Beat(is_news=True) | WaitTold() | HandTold() | BatteryTold():
                self.changed.add(body.machine.node_id)
            case TaskTold(report=report):
                self._on_report(body, report)
            case PlanTold() if body.task is not None:
                body.task.updates += 1

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

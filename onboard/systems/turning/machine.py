"""A lathe's steps: program to the control, set up, make the batch, one order after the other (rows P20, P23, P25)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.codes import CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.messages import Award, CallForProposals, Message, Reference, TaskReport
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.serial import successor
from onboard.core.site import Machine, Site
from onboard.systems.turning.generation import LatheGeneration
from onboard.systems.turning.lathe import Job
from onboard.systems.turning.messages import (
    LatheAction,
    LatheOrder,
    LathePhase,
    LatheProgress,
    NcMode,
    NcState,
    ToolState,
    text_frames,
)
from onboard.systems.turning.process import Process
from onboard.systems.turning.site import Turning

#: What the control does not confirm is said again after this, us. Ours.
AGAIN_US = 3_000_000
#: LatheProgress is repeated this often, us (dbc/turning.dbc).
PROGRESS_US = 10_000_000
#: Finished orders that are remembered, to say again that they are over.
MAX_OVER = 32


class Stage(Enum):
    """How far an order is, each a point from which a lathe that starts again can go on."""

    WON = "not begun"
    SETTING = "program loaded; being set up, or about to be"
    MAKING = "set up; parts are made"


@dataclass
class Undertaking:
    """An order in hand; ``process`` is worked out when it is begun, by the state that the lathe is in then (P20)."""

    task: Reference
    job: Job
    stage: Stage = Stage.WON
    process: Process | None = None


@dataclass(frozen=True)
class LatheFactory(BehaviourFactory):
    """Makes lathes."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> LatheGeneration:
        """The lathe's task-generation function; the mirror is of no use to it (row P21)."""
        if not isinstance(site, Turning):
            raise TypeError("a lathe needs a turning cell")
        return LatheGeneration(site, machine)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "LatheMachine":
        """The lathe's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, LatheGeneration):
            raise TypeError("a lathe needs its own task-generation function")
        return LatheMachine(fleet, estimator)


@dataclass
class LatheMachine:
    """One lathe. ``in_hand`` are its orders by name, in the order in which it won them; the first is worked on."""

    fleet: Fleet
    generation: LatheGeneration
    kind: KindCode = KindCode.LATHE
    in_hand: dict[Reference, Undertaking] = field(default_factory=dict)
    over: set[Reference] = field(default_factory=set)
    nc: NcState | None = None
    _sequence: int = 0
    _ordered: LatheOrder | None = None
    _again_us: int | None = None
    _progress_us: int | None = None
    _told: tuple[Reference, int, LathePhase] | None = None

    def __post_init__(self) -> None:
        self.fleet.negotiation.is_sound = self.generation.is_sound
        for entry in self.fleet.entries:
            self._replay(entry)
        self._engage()

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """Heartbeat state."""
        if self.nc is None:
            return MachineState.STARTING
        return MachineState.WORKING if self.in_hand else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """A lathe goes nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing before the control has told how it is."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """The control and the wear of the tools (row P24)."""
        match message:
            case NcState():
                if self.nc is None:
                    self._sequence = message.sequence
                self.nc = message
            case ToolState():
                self.generation.state.used_min[message.tool] = message.used_ms / 60_000
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """What orders are; calls and awards for what is in hand already."""
        self.generation.hear(message)
        match message:
            case Award() if message.winner == self.fleet.node_id and message.result is CallResult.AWARDED:
                return self._on_award(message)
            case Award(result=CallResult.AWARDED | CallResult.REJECTED) if message.task in self.in_hand:
                return self._yield(self.in_hand[message.task], message)
            case CallForProposals() if message.task in self.generation.known:
                return [self._report(message.task)]
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Bids are kept in mind; an order that is won is journalled before it is told."""
        match event:
            case PreAssigned(call_key=key, proposal=proposal):
                self.generation.promised[key] = proposal.program[0]
            case Released(call_key=key):
                self.generation.promised.pop(key, None)
            case Awarded(call_key=key, call=call, proposal=proposal):
                self.generation.promised.pop(key, None)
                one = self.in_hand[call.task] = Undertaking(call.task, proposal.program[0])
                self._engage()
                return [_won_record(one), self._report(one.task)]
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A lathe holds no tokens."""
        return Reason.NOT_AUTHORISED

    def advance(self, now_us: int) -> list[Effect]:
        """One step for the first order."""
        if self.nc is None or not self.in_hand:
            return []
        one = next(iter(self.in_hand.values()))
        if one.process is None:
            one.process = self.generation.make(one.job, self.generation.state)
            if one.process is None:
                return self._forfeit(one)
        return self._step(one, one.process, now_us) + self._progress(one, now_us)

    def next_wake(self) -> int | None:
        """When something is to be said again."""
        if self.nc is None:
            return None
        return min((time for time in (self._again_us, self._progress_us) if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """What is in hand and what is over."""
        self._told = None
        return [self._report(task) for task in (*self.in_hand, *sorted(self.over))]

    # --- orders ------------------------------------------------------------------------------------------------

    def _engage(self) -> None:
        self.generation.in_hand = {task: one.job for task, one in self.in_hand.items()}
        self.generation.known = {*self.in_hand, *self.over}

    def _on_award(self, award: Award) -> list[Effect]:
        """Said again: my word was lost. For a bid that I have forgotten: it is given back."""
        if award.task in self.generation.known:
            return [self._report(award.task)]
        if self.fleet.negotiation.knows(award.sender, award.call):
            return []
        return [Send(TaskReport(self.fleet.node_id, award.task, TaskPhase.FORFEITED, 0, Reason.JOURNAL_LOST))]

    def _yield(self, one: Undertaking, award: Award) -> list[Effect]:
        """Its desk gave to another, or to nobody, what I have not begun."""
        if one.stage is not Stage.WON or award.sender != one.task.origin:
            return []
        del self.in_hand[one.task]
        self._engage()
        return [Record(_named("job_lost", one))]

    def _forfeit(self, one: Undertaking) -> list[Effect]:
        """A journal from before the site file lost a drawing, say: nobody can make what is not drawn."""
        del self.in_hand[one.task]
        self._engage()
        return [
            _over_record(one),
            Send(TaskReport(self.fleet.node_id, one.task, TaskPhase.REFUSED, 0, Reason.IMPOSSIBLE)),
        ]

    def _finish(self, one: Undertaking) -> list[Effect]:
        del self.in_hand[one.task]
        self.over.add(one.task)
        if len(self.over) > MAX_OVER:
            self.over.discard(min(self.over))
        self._engage()
        self._progress_us = None
        return [_over_record(one), self._report(one.task), self._word(one, LathePhase.FINISHED, one.job.batch)]

    def _report(self, task: Reference) -> Send:
        phase = TaskPhase.AWARDED if task in self.in_hand else TaskPhase.DONE
        return Send(TaskReport(self.fleet.node_id, task, phase, 0, Reason.NONE))

    # --- steps -------------------------------------------------------------------------------------------------

    def _step(self, one: Undertaking, process: Process, now_us: int) -> list[Effect]:
        assert self.nc is not None
        if self.nc.nc_mode is not NcMode.READY:
            self._again_us = None
            return []
        if self._is_obeyed():
            self._ordered = None
        elif self._ordered is not None:
            return self._say_again(now_us, (self._ordered,))
        if one.stage is Stage.WON:
            return self._load(one, process, now_us)
        if one.stage is Stage.SETTING:
            return self._set_up(one, process, now_us)
        if self.nc.parts >= one.job.batch:
            return self._finish(one)
        return self._make(process, now_us)

    def _make(self, process: Process, now_us: int) -> list[Effect]:
        """The next part; an edge that would not last for it is changed before, by what its sensor says."""
        left_min = self.generation.state.left_min
        worn = {tool.number for tool in process.tools if left_min(tool) < process.wear_min[tool.number]}
        return self._order(LatheAction.MAKE, 0, sum(1 << number - 1 for number in worn), now_us)

    def _load(self, one: Undertaking, process: Process, now_us: int) -> list[Effect]:
        """The program to the control, until the control names it."""
        assert self.nc is not None
        number = _program_number(one.task)
        if self.nc.program != number:
            return self._say_again(now_us, text_frames(self.fleet.node_id, number, process.program))
        one.stage = Stage.SETTING
        self._again_us = None
        chuck = self.generation.lathe.chucks.index(process.clamping.chuck)
        return [_stage_record(one), *self._order(LatheAction.SET_UP, chuck, 0, now_us)]

    def _set_up(self, one: Undertaking, process: Process, now_us: int) -> list[Effect]:
        """The control has obeyed and is ready again: it is set up."""
        one.stage = Stage.MAKING
        self.generation.state.set_up_for = (one.job.drawing, process.clamping.chuck.name)
        return [_stage_record(one), *self._make(process, now_us)]

    def _order(self, action: LatheAction, chuck: int, edges: int, now_us: int) -> list[Effect]:
        self._sequence = successor(self._sequence, 8)
        self._ordered = LatheOrder(self.fleet.node_id, self._sequence, action, chuck, edges)
        self._again_us = None
        return self._say_again(now_us, (self._ordered,))

    def _is_obeyed(self) -> bool:
        return self._ordered is not None and self.nc is not None and self.nc.sequence == self._ordered.sequence

    def _say_again(self, now_us: int, messages: tuple[Message, ...]) -> list[Effect]:
        if self._again_us is not None and self._again_us > now_us:
            return []
        self._again_us = now_us + AGAIN_US
        return [Actuate(message) for message in messages]

    # --- words and memory --------------------------------------------------------------------------------------

    def _progress(self, one: Undertaking, now_us: int) -> list[Effect]:
        assert self.nc is not None
        if one.task not in self.in_hand:
            return []
        phase = {Stage.WON: LathePhase.QUEUED, Stage.SETTING: LathePhase.SETTING_UP}.get(one.stage, LathePhase.TURNING)
        made = min(self.nc.parts, one.job.batch) if one.stage is Stage.MAKING else 0
        told = (one.task, made, phase)
        if told == self._told and self._progress_us is not None and self._progress_us > now_us:
            return []
        self._told, self._progress_us = told, now_us + PROGRESS_US
        return [self._word(one, phase, made)]

    def _word(self, one: Undertaking, phase: LathePhase, made: int) -> Send:
        return Send(LatheProgress(self.fleet.node_id, *one.task, made, one.job.batch, phase))

    def _replay(self, entry: Mapping[str, str | int]) -> None:
        if entry.get("record") not in ("job", "job_stage", "job_over", "job_lost"):
            return
        task = Reference(int(entry["origin"]), int(entry["number"]))
        if entry["record"] == "job":
            bar_mm, face_mm = int(entry["bar_mm"]), int(entry["face_um"]) / 1000
            job = Job(int(entry["drawing"]), int(entry["material"]), bar_mm, int(entry["batch"]), face_mm)
            self.in_hand[task] = Undertaking(task, job)
        elif entry["record"] == "job_lost":
            self.in_hand.pop(task, None)
        elif entry["record"] == "job_over":
            self.in_hand.pop(task, None)
            self.over.add(task)
        elif task in self.in_hand and entry["stage"] == Stage.MAKING.name:
            # Whether an order to set up was obeyed is not known: it is given again.
            self.in_hand[task].stage = Stage.MAKING


def _program_number(task: Reference) -> int:
    """1 to 255: the control keeps one program at a time."""
    return (task.origin * 31 + task.number) % 255 + 1


def _named(record: str, one: Undertaking) -> dict[str, str | int]:
    return {"record": record, "origin": one.task.origin, "number": one.task.number}


def _won_record(one: Undertaking) -> Record:
    job = one.job
    entry = _named("job", one) | {"drawing": job.drawing, "material": job.material, "bar_mm": round(job.bar_mm)}
    return Record(entry | {"batch": job.batch, "face_um": round(job.face_mm * 1000)})


def _stage_record(one: Undertaking) -> Record:
    return Record(_named("job_stage", one) | {"stage": one.stage.name})


def _over_record(one: Undertaking) -> Record:
    return Record(_named("job_over", one))

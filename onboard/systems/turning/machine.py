"""A lathe's steps: program to the control, set up, make the batch, one order after the other (rows P20, P23, P25)."""

from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.codes import KindCode, MachineState, Reason, TaskPhase
from onboard.contract.messages import Message, Reference, TaskReport
from onboard.contract.turning import LatheAction, LathePhase, LatheProgress, NcMode
from onboard.contract.turning_device import LatheOrder, NcState, ToolState
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.journal_records import JournalRecord, records_in
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import ALONE, Permit, authorised
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.site import Machine, Site
from onboard.systems.turning.fields import text_frames
from onboard.systems.turning.generation import LatheGeneration
from onboard.systems.turning.lathe import TurningJob
from onboard.systems.turning.process import Process
from onboard.systems.turning.records import BatchStage, JobLostRecord, JobOverRecord, JobRecord, JobStageRecord
from onboard.systems.turning.site import Turning
from onboard.work.device_link import DeviceLink
from onboard.work.undertaking import TaskEvent, Undertakings

#: What the control does not confirm is said again after this, us: one frame and its answer on a device bus.
AGAIN_US = 3_000_000
#: A control that works hears its order so often, us (dbc/turning.dbc): else it stands, as after an emergency stop.
GO_ON_US = 1_000_000
#: LatheProgress is repeated this often, us (dbc/turning.dbc).
PROGRESS_US = 10_000_000


class Control(Enum):
    """What the control's last word comes to, for the order in hand."""

    BUSY = "it works, or is in no state to"
    UNMOVED = "it is ready, and has not obeyed the last order"
    OTHER_PROGRAM = "it is ready, and has not the program of this order, which is not begun"
    FREE = "it is ready for what comes next"
    ALL_MADE = "it is ready, and has made as many of this order as are wanted"


class Deed(Enum):
    """What the lathe does next."""

    GO_ON = "let the control go on: the order that it is at, again"
    SAY_AGAIN = "the last order again"
    LOAD = "the program to the control"
    SET_UP = "order to set up"
    BEGIN = "note that it is set up, and order the first part"
    MAKE = "order the next part"
    FINISH = "tell that the order is over"


#: (stage, control) -> (stage that follows, deed). The control counts parts anew when it is set up:
#: until then the count is of the order before.
TABLE: dict[tuple[BatchStage, Control], tuple[BatchStage, Deed]] = {
    (BatchStage.WON, Control.BUSY): (BatchStage.WON, Deed.GO_ON),
    (BatchStage.WON, Control.UNMOVED): (BatchStage.WON, Deed.SAY_AGAIN),
    (BatchStage.WON, Control.OTHER_PROGRAM): (BatchStage.WON, Deed.LOAD),
    (BatchStage.WON, Control.FREE): (BatchStage.SETTING, Deed.SET_UP),
    (BatchStage.SETTING, Control.BUSY): (BatchStage.SETTING, Deed.GO_ON),
    (BatchStage.SETTING, Control.UNMOVED): (BatchStage.SETTING, Deed.SAY_AGAIN),
    (BatchStage.SETTING, Control.FREE): (BatchStage.MAKING, Deed.BEGIN),
    (BatchStage.MAKING, Control.BUSY): (BatchStage.MAKING, Deed.GO_ON),
    (BatchStage.MAKING, Control.UNMOVED): (BatchStage.MAKING, Deed.SAY_AGAIN),
    (BatchStage.MAKING, Control.FREE): (BatchStage.MAKING, Deed.MAKE),
    (BatchStage.MAKING, Control.ALL_MADE): (BatchStage.MAKING, Deed.FINISH),
}


@dataclass
class Batch:
    """An order in hand; ``process`` is worked out when it is begun, by the state that the lathe is in then (P20)."""

    task: Reference
    job: TurningJob
    stage: BatchStage = BatchStage.WON
    process: Process | None = None


@dataclass(frozen=True)
class LatheFactory(BehaviourFactory):
    """Makes the lathes of a turning shop."""

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
    """One lathe; of ``tasks`` in hand the first is worked on."""

    fleet: Fleet
    generation: LatheGeneration
    kind: KindCode = KindCode.LATHE
    tasks: Undertakings[Batch] = field(init=False)
    nc: NcState | None = None
    link: DeviceLink[tuple[LatheAction, int, int]] = field(init=False)
    #: When the program is said again while the control does not name it, us.
    _program_again_us: int | None = None
    #: When the order that the control is at is said again, us.
    _go_on_us: int | None = None
    _progress_us: int | None = None
    _told: tuple[Reference, int, LathePhase] | None = None

    def __post_init__(self) -> None:
        self.fleet.negotiation.is_sound = self.generation.is_sound
        me = self.fleet.node_id
        self.link = DeviceLink(lambda sequence, order: LatheOrder(me, sequence, *order), AGAIN_US)
        self.tasks = Undertakings(
            self.fleet,
            is_begun=lambda one: one.stage is not BatchStage.WON,
            may_give=lambda one, node: node == one.task.origin,
            lose=lambda one: [Record(JobLostRecord(one.task))],
            changed=self._engage,
        )
        for record in records_in(self.fleet.entries, JobRecord, JobStageRecord, JobLostRecord, JobOverRecord):
            self._replay(record)
        self._engage()

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """STARTING until the control is heard, then IDLE or WORKING, for heartbeats."""
        if self.nc is None:
            return MachineState.STARTING
        return MachineState.WORKING if self.tasks.in_hand else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """Always 0, for a lathe goes nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing before the control has told how it is."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """The control and the wear of the tools (row P24)."""
        match message:
            case NcState():
                if self.nc is None:
                    self.link.go_on_from(message.sequence)
                self.nc = message
                if message.nc_mode is NcMode.READY:
                    self._go_on_us = None
            case ToolState():
                self.generation.state.used_min[message.tool] = message.used_ms / 60_000
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """What orders are; calls and awards for what is in hand already."""
        self.generation.hear(message)
        return self.tasks.hear(message)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Bids are kept in mind; an order that is won is journalled before it is told."""
        match event:
            case PreAssigned(call_key=key, proposal=proposal):
                self.generation.promised[key] = proposal.program[0]
            case Released(call_key=key):
                self.generation.promised.pop(key, None)
            case Awarded(call_key=key, call=call, proposal=proposal):
                self.generation.promised.pop(key, None)
                one = Batch(call.task, proposal.program[0])
                self.tasks.meet(call.task, TaskEvent.WIN, one)
                return [_won_record(one), self.tasks.report(one.task)]
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A lathe holds no tokens."""
        return Reason.NOT_AUTHORISED

    def advance(self, now_us: int) -> list[Effect]:
        """One step for the first order."""
        if self.nc is None or not self.tasks.in_hand:
            return []
        one = next(iter(self.tasks.in_hand.values()))
        if one.process is None:
            one.process = self.generation.make(one.job, self.generation.state)
            if one.process is None:
                return self._forfeit(one)
        return self._step(one, one.process, now_us) + self._progress(one, now_us)

    def next_wake(self) -> int | None:
        """When something is to be said again: nothing is without an order in hand."""
        if self.nc is None or not self.tasks.in_hand:
            return None
        times = (self.link.due_us, self._program_again_us, self._go_on_us, self._progress_us)
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """What is in hand and what is over."""
        self._told = None
        return self.tasks.reports()

    # --- orders ------------------------------------------------------------------------------------------------

    def _engage(self) -> None:
        self.generation.in_hand = {task: one.job for task, one in self.tasks.in_hand.items()}
        self.generation.known = {*self.tasks.in_hand, *self.tasks.over}

    def _forfeit(self, one: Batch) -> list[Effect]:
        """A journal from before the site file lost a drawing, say: nobody can make what is not drawn."""
        self.tasks.meet(one.task, TaskEvent.GIVE_UP)
        refused = TaskReport(self.fleet.node_id, one.task, TaskPhase.REFUSED, 0, Reason.IMPOSSIBLE)
        return [_over_record(one), Send(refused)]

    def _finish(self, one: Batch) -> list[Effect]:
        self.tasks.meet(one.task, TaskEvent.END)
        self._progress_us = None
        return [_over_record(one), self.tasks.report(one.task), self._word(one, LathePhase.FINISHED, one.job.batch)]

    # --- steps -------------------------------------------------------------------------------------------------

    def _step(self, one: Batch, process: Process, now_us: int) -> list[Effect]:
        """One line of ``TABLE``; a new stage is journalled before what follows from it."""
        assert self.nc is not None
        if self.link.is_obeyed(self.nc.sequence) and self.nc.nc_mode is NcMode.READY:
            self.link.rest()
        following, deed = TABLE[one.stage, self._control(self.nc, one)]
        written: list[Effect] = []
        if following is not one.stage:
            one.stage = following
            written = [_stage_record(one)]
        match deed:
            case Deed.GO_ON:
                self.link.pause()
                self._program_again_us = None
                return written + self._go_on(one, self.nc, now_us)
            case Deed.SAY_AGAIN:
                return written + self.link.again(now_us)
            case Deed.LOAD:
                return written + self._load(one, process, now_us)
            case Deed.SET_UP:
                self._program_again_us = None
                chuck = self.generation.lathe.chucks.index(process.clamping.chuck)
                return written + self.link.order((LatheAction.SET_UP, chuck, 0), self._permit(), now_us)
            case Deed.BEGIN:
                self.generation.state.set_up_for = (one.job.drawing, process.clamping.chuck.name)
                return written + self._make(process, now_us)
            case Deed.MAKE:
                return written + self._make(process, now_us)
            case Deed.FINISH:
                return written + self._finish(one)

    def _go_on(self, one: Batch, nc: NcState, now_us: int) -> list[Effect]:
        """What the control is at, also by the order of an earlier life: a number that it knows starts nothing."""
        if self._go_on_us is not None and now_us < self._go_on_us:
            return []
        self._go_on_us = now_us + GO_ON_US
        action = LatheAction.MAKE if one.stage is BatchStage.MAKING else LatheAction.SET_UP
        return self._permit().order(LatheOrder(self.fleet.node_id, nc.sequence, action, 0, 0))

    def _control(self, nc: NcState, one: Batch) -> Control:
        """What the control's last word comes to."""
        if nc.nc_mode is not NcMode.READY:
            return Control.BUSY
        if self.link.wanted is not None:
            return Control.UNMOVED
        if one.stage is BatchStage.WON and nc.program != _program_number(one.task):
            return Control.OTHER_PROGRAM
        return Control.ALL_MADE if one.stage is BatchStage.MAKING and nc.parts >= one.job.batch else Control.FREE

    def _make(self, process: Process, now_us: int) -> list[Effect]:
        """The next part; an edge that would not last for it is changed before, by what its sensor says."""
        left_min = self.generation.state.left_min
        worn = {tool.number for tool in process.tools if left_min(tool) < process.wear_min[tool.number]}
        edges = sum(1 << number - 1 for number in worn)
        return self.link.order((LatheAction.MAKE, 0, edges), self._permit(), now_us)

    def _permit(self) -> Permit:
        return authorised(self.fleet.motion, ALONE)

    def _load(self, one: Batch, process: Process, now_us: int) -> list[Effect]:
        """The program to the control, until the control names it."""
        if self._program_again_us is not None and self._program_again_us > now_us:
            return []
        self._program_again_us = now_us + AGAIN_US
        frames = text_frames(self.fleet.node_id, _program_number(one.task), process.program)
        return [Tell(message) for message in frames]

    # --- words and memory --------------------------------------------------------------------------------------

    def _progress(self, one: Batch, now_us: int) -> list[Effect]:
        assert self.nc is not None
        if one.task not in self.tasks.in_hand:
            return []
        phase = {BatchStage.WON: LathePhase.QUEUED, BatchStage.SETTING: LathePhase.SETTING_UP}.get(
            one.stage, LathePhase.TURNING
        )
        made = min(self.nc.parts, one.job.batch) if one.stage is BatchStage.MAKING else 0
        told = (one.task, made, phase)
        if told == self._told and self._progress_us is not None and self._progress_us > now_us:
            return []
        self._told, self._progress_us = told, now_us + PROGRESS_US
        return [self._word(one, phase, made)]

    def _word(self, one: Batch, phase: LathePhase, made: int) -> Send:
        return Send(LatheProgress(self.fleet.node_id, *one.task, made, one.job.batch, phase))

    def _replay(self, record: JournalRecord) -> None:
        match record:
            case JobRecord(task=task):
                self.tasks.in_hand[task] = Batch(task, record.job)
            case JobLostRecord(task=task):
                self.tasks.in_hand.pop(task, None)
            case JobOverRecord(task=task):
                self.tasks.remember(task)
            case JobStageRecord(task=task, stage=BatchStage.MAKING) if task in self.tasks.in_hand:
                # Whether an order to set up was obeyed is not known: it is given again.
                self.tasks.in_hand[task].stage = BatchStage.MAKING


def _program_number(task: Reference) -> int:
    """1 to 255: the control keeps one program at a time."""
    return (task.origin * 31 + task.number) % 255 + 1


def _won_record(one: Batch) -> Record:
    job = one.job
    face_um = round(job.face_mm * 1000)
    return Record(JobRecord(one.task, job.drawing, job.material, round(job.bar_mm), job.batch, face_um))


def _stage_record(one: Batch) -> Record:
    return Record(JobStageRecord(one.task, one.stage))


def _over_record(one: Batch) -> Record:
    return Record(JobOverRecord(one.task))

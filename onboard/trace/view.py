"""The site as the bus tells it: fed with decoded fleet messages and nothing else (row P54).

The terminal picture, the summary and the events in words all come from here, so they can be drawn from a live bus, a
simulated one or a recorded log alike.
"""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from onboard.core.codes import (
    ANY_STATION,
    OUTSIDE,
    STILL,
    CallResult,
    Criterion,
    Grade,
    MachineState,
    ManualMode,
    Operation,
    Reason,
    TaskPhase,
)
from onboard.core.messages import (
    Award,
    Bid,
    Blocked,
    CallForProposals,
    CarAt,
    Clear,
    Heartbeat,
    Itinerary,
    ManualState,
    Message,
    Progress,
    Reference,
    TaskReport,
    Waiting,
)
from onboard.core.recovery_messages import Halted
from onboard.core.site import Segment, Site
from onboard.systems.words import words_of

_Key = TypeVar("_Key")
_Record = TypeVar("_Record")

#: Events in words that are kept.
EVENT_LIMIT = 200
#: Calls and tasks that are kept, so that a picture may stay open for ever: those that are over go first, the oldest of
#: them. A site of 24 machines has fewer than 20 open at a time, and what is asked about was lately.
CALL_LIMIT, TASK_LIMIT = 512, 512
#: Phases of tasks after which nothing is waited for.
TASKS_OVER = (TaskPhase.DONE, TaskPhase.REFUSED)
#: Ends of a call after which its task has neither an owner nor a call.
CALLS_OVER = (CallResult.REFUSED, CallResult.WITHDRAWN, CallResult.REJECTED)

#: Who has a hand in a machine, and whether it stands.
_HANDS = {
    (mode, at_rest): words + (" and stands" if at_rest else "")
    for mode, words in (
        (ManualMode.AUTOMATIC, "goes on by itself"),
        (ManualMode.HELD, "is held by a person"),
        (ManualMode.STEP, "does one step for a person"),
    )
    for at_rest in (False, True)
}


@dataclass
class CallRecord:
    """One call as seen on the bus; times in us of the log."""

    call: CallForProposals
    opened_us: int
    bids: list[tuple[int, int, int]] = field(default_factory=list)
    winner: int = 0
    result: CallResult | None = None
    reason: Reason = Reason.NONE
    awards: int = 0


@dataclass
class TaskRecord:
    """One task: the last phase told, when each phase was first told, and its calls."""

    operation: Operation
    calls: int = 0
    owner: int = 0
    phase: TaskPhase = TaskPhase.OPEN
    phase_us: dict[TaskPhase, int] = field(default_factory=dict)
    promised_ms: int | None = None
    depth: int = 0
    #: What is carried or worked on; where no call told it, the task's own name.
    load: Reference | None = None
    #: Whether its last call ended without a winner and was not opened again: until it is called once more.
    is_closed: bool = False

    @property
    def is_waiting(self) -> bool:
        """Whether somebody waits for its end; a sub-task is nobody's until it is awarded."""
        return self.phase not in TASKS_OVER and not self.is_closed and (self.depth == 0 or self.owner != 0)


class SiteView:
    """What an observer of the fleet bus knows of a site."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.now_us = 0
        self.positions: dict[int, tuple[Segment, int]] = {}
        self.states: dict[int, MachineState] = {}
        self.cars: dict[Reference, int] = {}
        self.aboard: dict[int, Reference | None] = {}
        self.itineraries: dict[int, Itinerary] = {}
        self.calls: dict[tuple[int, int], CallRecord] = {}
        self.tasks: dict[Reference, TaskRecord] = {}
        self.messages: Counter[str] = Counter()
        self.bids = 0
        self.calls_opened = 0
        self.calls_closed: Counter[CallResult] = Counter()
        self.parked = 0
        self.fetched = 0
        self.done = 0
        #: From the first call for each to its end, all tasks that are done together.
        self.done_us = 0
        self.blocked: set[Segment] = set()
        #: Why each machine that does not act does not, by its own last word, or by a neighbour's.
        self.halts: dict[int, Halted] = {}
        self.words = words_of(site)
        self.events: deque[tuple[int, str]] = deque(maxlen=EVENT_LIMIT)
        for machine in site.machines.values():
            self.positions[machine.node_id] = (machine.home, 0)

    def name(self, node: int) -> str:
        """A machine's name, or its node-ID where the site has none for it."""
        return self.words.machine(node)

    def _on_halted(self, halted: Halted, time_us: int) -> None:
        before = self.halts.get(halted.machine)
        self.halts[halted.machine] = halted
        what = halted.reason, halted.cause, halted.needs_person
        if before is not None and what == (before.reason, before.cause, before.needs_person):
            return
        why = self.words.reason(halted.reason) + (f", by {self.name(halted.cause)}" if halted.cause else "")
        person = "; a person must decide" if halted.needs_person else ""
        self.say(time_us, f"{self.name(halted.machine)} does not act: {why}{person}")

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message of the fleet bus."""
        self.now_us = time_us
        self.words.hear(message)
        self.messages[type(message).__name__] += 1
        match message:
            case Heartbeat():
                self._on_heartbeat(message)
            case Progress():
                self._on_progress(message)
            case CarAt():
                self._on_car(message)
            case CallForProposals():
                self._on_call(message, time_us)
            case Bid():
                self._on_bid(message, time_us)
            case Award():
                self._on_award(message, time_us)
            case Itinerary() if message.grade is Grade.FIRM:
                self.itineraries[message.sender] = message
            case TaskReport():
                self._on_report(message, time_us)
            case Waiting() | Blocked() | Clear() | ManualState() | Halted():
                self._on_word(message, time_us)

    def _on_progress(self, told: Progress) -> None:
        here, word = (Segment(told.track, told.index), told.offset_mm), self.halts.get(told.sender)
        if word is not None and word.reason is Reason.FALSE_STATEMENT and here != self.positions.get(told.sender):
            # Said by others, because it stood: it moves.
            del self.halts[told.sender]
        self.positions[told.sender] = here

    def _on_heartbeat(self, beat: Heartbeat) -> None:
        self.states[beat.sender] = beat.state
        word = self.halts.get(beat.sender)
        if word is not None and beat.state not in STILL and word.reason is not Reason.FALSE_STATEMENT:
            del self.halts[beat.sender]

    def _on_word(self, message: Waiting | Blocked | Clear | ManualState | Halted, time_us: int) -> None:
        if isinstance(message, Halted):
            self._on_halted(message, time_us)
            return
        if isinstance(message, Blocked):
            self.blocked.add(Segment(message.track, message.index))
        elif isinstance(message, Clear):
            self.blocked.discard(Segment(message.track, message.index))
        self.say(time_us, self._told_of(message))

    def _told_of(self, message: Waiting | Blocked | Clear | ManualState) -> str:
        """What is said of one segment, or of a person's hand in a machine, in words."""
        if isinstance(message, ManualState):
            return f"{self.name(message.sender)} {_HANDS[message.manual_mode, message.at_rest]}"
        where, why = self.words.slot(message.track, message.index), self.words.reason(message.reason)
        if isinstance(message, Waiting):
            blocker = f" of {self.name(message.blocker)}" if message.blocker else ""
            return f"{self.name(message.sender)} waits for {where}{blocker}: {why}"
        return f"{where} is {'blocked' if isinstance(message, Blocked) else 'clear again'}: {why}"

    def places_taken(self) -> dict[int, Reference]:
        """Car by station number, for cars that stand at one."""
        return {station: car for car, station in self.cars.items() if station not in (ANY_STATION, OUTSIDE)}

    def say(self, time_us: int, text: str) -> None:
        """One more event in words."""
        self.events.append((time_us, text))

    def _on_car(self, message: CarAt) -> None:
        if message.station == ANY_STATION:
            self.aboard[message.sender] = message.car
        else:
            self.aboard = {node: car for node, car in self.aboard.items() if car != message.car}
        if message.station == OUTSIDE:
            self.cars.pop(message.car, None)
        else:
            self.cars[message.car] = message.station

    def _on_call(self, call: CallForProposals, time_us: int) -> None:
        key = (call.sender, call.call)
        if key in self.calls:
            return
        self.calls_opened += 1
        self.calls[key] = CallRecord(call, time_us)
        if self.open_task(call.task, call.operation, time_us):
            self.tasks[call.task].depth = call.depth
        self.tasks[call.task].calls += 1
        self.tasks[call.task].is_closed = False
        self.tasks[call.task].load = call.car
        _bound(self.calls, CALL_LIMIT, lambda record: record.result is not None)
        self.say(
            time_us,
            f"{self.name(call.sender)} calls: {self.words.operation(call.operation)} {self.words.thing(call.car)}",
        )

    def open_task(self, reference: Reference, operation: Operation, time_us: int) -> bool:
        """A task is told for the first time, by a call or otherwise; False where it was known."""
        if reference in self.tasks:
            return False
        self.tasks[reference] = TaskRecord(operation, phase_us={TaskPhase.OPEN: time_us})
        _bound(self.tasks, TASK_LIMIT, lambda task: not task.is_waiting)
        return True

    def own(self, reference: Reference, owner: int) -> None:
        """Who has a task, 0 for nobody any more, where no award of a call tells it."""
        if reference in self.tasks:
            self.tasks[reference].owner = owner
            self.tasks[reference].phase = TaskPhase.AWARDED if owner else TaskPhase.OPEN

    def end(self, reference: Reference, time_us: int) -> None:
        """A task is done, where no report tells it."""
        task = self.tasks.get(reference)
        if task is not None and task.phase not in TASKS_OVER:
            task.phase = TaskPhase.DONE
            self.done += 1
            self.done_us += time_us - task.phase_us.get(TaskPhase.OPEN, time_us)

    def _on_bid(self, bid: Bid, time_us: int) -> None:
        self.bids += 1
        record = self.calls.get((bid.initiator, bid.call))
        if record is not None:
            record.bids.append((time_us, bid.sender, bid.cost))
            self.say(time_us, f"{self.name(bid.sender)} bids for {self.words.thing(record.call.car)}")

    def _on_award(self, award: Award, time_us: int) -> None:
        record = self.calls.get((award.sender, award.call))
        if record is None:
            return
        record.awards += 1
        if record.result is not None or award.result is CallResult.OPTION:
            return
        record.result, record.winner, record.reason = award.result, award.winner, award.reason
        self.calls_closed[award.result] += 1
        self.open_task(record.call.task, record.call.operation, record.opened_us)
        task = self.tasks[record.call.task]
        if award.result in CALLS_OVER and record.call.operation is task.operation:
            task.is_closed = True
        if award.result is CallResult.AWARDED:
            if record.call.operation is not task.operation:
                self.say(time_us, f"{self.name(award.winner)} takes {self.name(award.sender)} along")
                return
            task.owner = award.winner
            if record.call.criterion is Criterion.FINISH_TIME:
                task.promised_ms = next((cost for _, node, cost in reversed(record.bids) if node == award.winner), None)
            self.say(time_us, f"{self.name(award.winner)} wins {self.words.thing(record.call.car)}")
        else:
            self.say(time_us, f"call for {self.words.thing(record.call.car)} ends: {award.result.name.lower()}")

    def _on_report(self, report: TaskReport, time_us: int) -> None:
        task = self.tasks.get(report.task)
        if task is None:
            return
        first = report.phase not in task.phase_us
        task.phase = report.phase
        if first and report.phase is TaskPhase.AWARDED and not task.owner:
            # Ordered by name, without a call.
            task.owner = report.sender
        task.phase_us.setdefault(report.phase, time_us)
        if not first:
            return
        if report.phase is TaskPhase.DONE:
            self.done += 1
            self.done_us += time_us - task.phase_us.get(TaskPhase.OPEN, time_us)
            self.parked += task.operation is Operation.PARK
            self.fetched += task.operation is Operation.RETRIEVE
        words = self.words.report(task.operation, report.phase, task.load or report.task, report.station)
        if words:
            self.say(time_us, f"{self.name(report.sender)} {words}")


def _bound(records: dict[_Key, _Record], most: int, is_over: Callable[[_Record], bool]) -> None:
    """Drop the oldest that is over, else the oldest, where there are more than ``most``."""
    if len(records) > most:
        del records[next((key for key, record in records.items() if is_over(record)), next(iter(records)))]

"""The site as the bus tells it: fed with decoded fleet messages and nothing else (row P54).

The terminal picture, the summary and the events in words all come from here, so they can be drawn from a live bus, a
simulated one or a recorded log alike.
"""

from collections import Counter, deque

from onboard.contract.codes import CallResult, Grade, ManualMode, Operation, Reason, TaskPhase
from onboard.contract.constants import ANY_STATION, OUTSIDE, STILL
from onboard.contract.messages import (
    Blocked,
    CarAt,
    Clear,
    Halted,
    Heartbeat,
    Itinerary,
    ManualState,
    Message,
    Progress,
    Reference,
    Waiting,
)
from onboard.core.site import Segment, Site
from onboard.history.calls import BidMade, CallAnswered, CallHistory, CallOpened
from onboard.history.history import Fact, History
from onboard.history.tasks import TaskHistory, TaskTold
from onboard.systems.words import words_of

#: Events in words that are kept.
EVENT_LIMIT = 200
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


class SiteView:
    """What an observer of the fleet bus knows of a site."""

    def __init__(self, site: Site, history: History | None = None) -> None:
        self.site = site
        self.history = history if history is not None else History()
        self.now_us = 0
        self.positions: dict[int, tuple[Segment, int]] = {}
        self.cars: dict[Reference, int] = {}
        self.aboard: dict[int, Reference | None] = {}
        self.itineraries: dict[int, Itinerary] = {}
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

    @property
    def calls(self) -> dict[tuple[int, int], CallHistory]:
        """Calls by their caller and number."""
        return self.history.calls.by_key

    @property
    def tasks(self) -> dict[Reference, TaskHistory]:
        """Tasks by their names."""
        return self.history.tasks.by_name

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message of the fleet bus, where the history is this view's own."""
        self.take(message, self.history.feed(message, time_us), time_us)

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Take up one message of the fleet bus, and what the history made of it."""
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
            case Itinerary() if message.grade is Grade.FIRM:
                self.itineraries[message.sender] = message
            case Waiting() | Blocked() | Clear() | ManualState() | Halted():
                self._on_word(message, time_us)
        self._deal(fact, time_us)

    def _deal(self, fact: Fact | None, time_us: int) -> None:
        match fact:
            case CallOpened():
                self.calls_opened += 1
                call = fact.call.terms
                what = f"{self.words.operation(call.operation)} {self.words.thing(call.car)}"
                self.say(time_us, f"{self.name(call.sender)} calls: {what}")
            case BidMade():
                self.bids += 1
                if fact.call is not None:
                    self.say(time_us, f"{self.name(fact.bid.sender)} bids for {self.words.thing(fact.call.terms.car)}")
            case CallAnswered() if fact.call is not None and fact.is_end:
                self._on_end(fact.call, fact, time_us)
            case TaskTold() if fact.is_first:
                self._on_phase(fact, time_us)

    def _on_progress(self, statement: Progress) -> None:
        here, word = (Segment(statement.track, statement.index), statement.offset_mm), self.halts.get(statement.sender)
        if word is not None and word.reason is Reason.FALSE_STATEMENT and here != self.positions.get(statement.sender):
            # Said by others, because it stood: it moves.
            del self.halts[statement.sender]
        self.positions[statement.sender] = here

    def _on_heartbeat(self, beat: Heartbeat) -> None:
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

    def end(self, reference: Reference, time_us: int) -> None:
        """A task is done, where no report tells it."""
        task = self.tasks.get(reference)
        if task is not None and not task.is_over:
            task.phase = TaskPhase.DONE
            self._count_done(task, time_us)

    def _on_end(self, call: CallHistory, end: CallAnswered, time_us: int) -> None:
        award = end.award
        self.calls_closed[award.result] += 1
        terms, thing = call.terms, self.words.thing(call.terms.car)
        if award.result is not CallResult.AWARDED:
            self.say(time_us, f"call for {thing} ends: {award.result.name.lower()}")
        elif terms.operation is not self.tasks[terms.task].operation:
            self.say(time_us, f"{self.name(award.winner)} takes {self.name(award.sender)} along")
        else:
            self.say(time_us, f"{self.name(award.winner)} wins {thing}")

    def _on_phase(self, statement: TaskTold, time_us: int) -> None:
        task, report = statement.task, statement.report
        if report.phase is TaskPhase.DONE:
            self._count_done(task, time_us)
            self.parked += task.operation is Operation.PARK
            self.fetched += task.operation is Operation.RETRIEVE
        words = self.words.report(task.operation, report.phase, task.load or report.task, report.station)
        if words:
            self.say(time_us, f"{self.name(report.sender)} {words}")

    def _count_done(self, task: TaskHistory, time_us: int) -> None:
        self.done += 1
        self.done_us += time_us - task.phase_us.get(TaskPhase.OPEN, time_us)

"""The site as the bus tells it: fed with decoded fleet messages and nothing else (row P54).

The terminal picture, the summary and the events in words all come from here, so they can be drawn from a live bus, a
simulated one or a recorded log alike.
"""

from collections import Counter, deque

from onboard.contract.codes import CallResult, ManualMode, Operation, TaskPhase
from onboard.contract.messages import Message, Reference
from onboard.core.site import Site
from onboard.history.batteries import BatteryTold
from onboard.history.calls import BidMade, CallAnswered, CallHistory, CallOpened
from onboard.history.halts import HaltTold
from onboard.history.hands import HandTold
from onboard.history.history import Fact, History
from onboard.history.lives import WaitTold
from onboard.history.orders import SlotTold
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
        self.history = history if history is not None else History(site)
        self.now_us = 0
        self.messages: Counter[str] = Counter()
        self.bids = 0
        self.calls_opened = 0
        self.calls_closed: Counter[CallResult] = Counter()
        self.parked = 0
        self.fetched = 0
        self.done = 0
        #: From the first call for each to its end, all tasks that are done together.
        self.done_us = 0
        self.words = words_of(site)
        self.events: deque[tuple[int, str]] = deque(maxlen=EVENT_LIMIT)

    def name(self, node: int) -> str:
        """A machine's name, or its node-ID where the site has none for it."""
        return self.words.machine(node)

    @property
    def calls(self) -> dict[tuple[int, int], CallHistory]:
        """Calls by their caller and number."""
        return self.history.calls.by_key

    @property
    def tasks(self) -> dict[Reference, TaskHistory]:
        """Every task that was heard of, by its name on the bus."""
        return self.history.tasks.by_name

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message of the fleet bus, where the history is this view's own."""
        self.take(message, self.history.feed(message, time_us), time_us)

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Take up one message of the fleet bus, and what the history made of it."""
        self.now_us = time_us
        self.words.hear(message)
        self.messages[type(message).__name__] += 1
        self._deal(fact, time_us)
        match fact:
            case HaltTold():
                self._on_halt(fact, time_us)
            case WaitTold():
                self.say(time_us, self._wait(fact))
            case SlotTold():
                self.say(time_us, self._slot(fact))
            case BatteryTold():
                self._on_battery(fact, time_us)
            case HandTold(word=word):
                self.say(time_us, f"{self.name(word.sender)} {_HANDS[word.manual_mode, word.at_rest]}")

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

    def _on_halt(self, statement: HaltTold, time_us: int) -> None:
        halted, before = statement.word, statement.before[1] if statement.before is not None else None
        what = halted.reason, halted.cause, halted.needs_person
        if before is not None and what == (before.reason, before.cause, before.needs_person):
            return
        why = self.words.reason(halted.reason) + (f", by {self.name(halted.cause)}" if halted.cause else "")
        person = "; a person must decide" if halted.needs_person else ""
        self.say(time_us, f"{self.name(halted.machine)} does not act: {why}{person}")

    def _on_battery(self, told: BatteryTold, time_us: int) -> None:
        name = self.name(told.word.sender)
        if told.is_empty_now:
            self.say(time_us, f"{name} stands: its battery is empty")
        elif told.bids_changed:
            level = f"its battery is {told.word.charge_permille / 10:.0f} % full"
            self.say(time_us, f"{name} bids again: {level}" if told.word.bids else f"{name} charges first: {level}")

    def _wait(self, statement: WaitTold) -> str:
        word = statement.word
        where, why = self.words.slot(word.track, word.index), self.words.reason(word.reason)
        blocker = f" of {self.name(word.blocker)}" if word.blocker else ""
        return f"{self.name(word.sender)} waits for {where}{blocker}: {why}"

    def _slot(self, statement: SlotTold) -> str:
        word = statement.word
        where, why = self.words.slot(word.track, word.index), self.words.reason(word.reason)
        return f"{where} is {'blocked' if statement.is_blocked else 'clear again'}: {why}"

    def say(self, time_us: int, text: str) -> None:
        """One more event in words."""
        self.events.append((time_us, text))

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
        assert task is not None, "who is first tells of a task that is known"
        if report.phase is TaskPhase.DONE:
            self._count_done(task, time_us)
            self.parked += task.operation is Operation.PARK and not task.is_aside(report.task)
            self.fetched += task.operation is Operation.RETRIEVE
        words = self.words.report(task.operation, report.phase, task.load or report.task, report.station)
        if words:
            self.say(time_us, f"{self.name(report.sender)} {words}")

    def _count_done(self, task: TaskHistory, time_us: int) -> None:
        self.done += 1
        self.done_us += time_us - task.phase_us.get(TaskPhase.OPEN, time_us)

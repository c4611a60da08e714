"""The site as the bus tells it: fed with decoded fleet messages and nothing else (row P54).

The terminal picture, the summary and the events in words all come from here, so they can be drawn from a live bus, a
simulated one or a recorded log alike.
"""

from collections import Counter, deque
from dataclasses import dataclass, field

from onboard.core.codes import ANY_STATION, OUTSIDE, CallResult, Grade, MachineState, Operation, Reason, TaskPhase
from onboard.core.messages import (
    Award,
    Bid,
    Blocked,
    CallForProposals,
    CarAt,
    Clear,
    Heartbeat,
    Itinerary,
    Message,
    Progress,
    Reference,
    TaskReport,
    Waiting,
)
from onboard.core.site import Segment, Site, Station

#: Events in words that are kept.
EVENT_LIMIT = 200


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
        self.events: deque[tuple[int, str]] = deque(maxlen=EVENT_LIMIT)
        for machine in site.machines.values():
            self.positions[machine.node_id] = (machine.home, 0)

    def name(self, node: int) -> str:
        """A machine's name, or its node-ID where the site has none for it."""
        machine = self.site.machines.get(node)
        return machine.name if machine is not None else f"node {node}"

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message of the fleet bus."""
        self.now_us = time_us
        self.messages[type(message).__name__] += 1
        match message:
            case Heartbeat():
                self.states[message.sender] = message.state
            case Progress():
                self.positions[message.sender] = (Segment(message.track, message.index), message.offset_mm)
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
            case Waiting() | Blocked() | Clear():
                self._say(time_us, self._told_of(message))

    def _told_of(self, message: Waiting | Blocked | Clear) -> str:
        """What is said of one segment, in words."""
        where = Segment(message.track, message.index)
        why = message.reason.name.lower().replace("_", " ")
        if isinstance(message, Waiting):
            blocker = f" of {self.name(message.blocker)}" if message.blocker else ""
            return f"{self.name(message.sender)} waits for {where}{blocker}: {why}"
        return f"{where} is {'blocked' if isinstance(message, Blocked) else 'clear again'}: {why}"

    def forget(self, keep: int) -> None:
        """Let go of calls and tasks that are over but the newest ``keep`` of each: for who listens without end.

        Of tasks no more than four times as many stay, whatever was heard of them.
        """
        closed = [key for key, record in self.calls.items() if record.result is not None]
        for key in closed[: max(0, len(closed) - keep)]:
            del self.calls[key]
        over = [task for task, record in self.tasks.items() if record.phase in (TaskPhase.DONE, TaskPhase.REFUSED)]
        called = {record.call.task for record in self.calls.values()}
        for task in over[: max(0, len(over) - keep)]:
            if task not in called:
                del self.tasks[task]
        for task in list(self.tasks)[: max(0, len(self.tasks) - 4 * keep)]:
            del self.tasks[task]

    def places_taken(self) -> dict[int, Reference]:
        """Car by station number, for cars that stand at one."""
        return {station: car for car, station in self.cars.items() if station not in (ANY_STATION, OUTSIDE)}

    def _say(self, time_us: int, text: str) -> None:
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
        task = self.tasks.setdefault(call.task, TaskRecord(call.operation))
        task.calls += 1
        task.phase_us.setdefault(TaskPhase.OPEN, time_us)
        self._say(time_us, f"{self.name(call.sender)} calls: {call.operation.name.lower()} car {call.car.number}")

    def _on_bid(self, bid: Bid, time_us: int) -> None:
        self.bids += 1
        record = self.calls.get((bid.initiator, bid.call))
        if record is not None:
            record.bids.append((time_us, bid.sender, bid.cost))
            self._say(time_us, f"{self.name(bid.sender)} bids for car {record.call.car.number}")

    def _on_award(self, award: Award, time_us: int) -> None:
        record = self.calls.get((award.sender, award.call))
        if record is None:
            return
        record.awards += 1
        if record.result is not None or award.result is CallResult.OPTION:
            return
        record.result, record.winner, record.reason = award.result, award.winner, award.reason
        self.calls_closed[award.result] += 1
        task = self.tasks.setdefault(record.call.task, TaskRecord(record.call.operation))
        if award.result is CallResult.AWARDED:
            if record.call.operation is not task.operation:
                self._say(time_us, f"{self.name(award.winner)} takes {self.name(award.sender)} along")
                return
            task.owner = award.winner
            task.promised_ms = next((cost for _, node, cost in reversed(record.bids) if node == award.winner), None)
            self._say(time_us, f"{self.name(award.winner)} wins car {record.call.car.number}")
        else:
            self._say(time_us, f"call for car {record.call.car.number} ends: {award.result.name.lower()}")

    def _on_report(self, report: TaskReport, time_us: int) -> None:
        task = self.tasks.get(report.task)
        if task is None:
            return
        first = report.phase not in task.phase_us
        task.phase = report.phase
        task.phase_us.setdefault(report.phase, time_us)
        if not first or report.phase not in _WORDS:
            return
        if report.phase is TaskPhase.DONE:
            self.parked += task.operation is Operation.PARK
            self.fetched += task.operation is Operation.RETRIEVE
        where = self._station(report.station)
        what = "parked" if task.operation is Operation.PARK else "fetched"
        words = _WORDS[report.phase].format(what=what, where=where)
        self._say(time_us, f"{self.name(report.sender)} {words}")

    def _station(self, number: int) -> str:
        for node, station in self.site.compartments.items():
            if station.number == number:
                return self.name(node)
        return str(Station.from_number(number)) if number not in (ANY_STATION, OUTSIDE) else "outside"


_WORDS = {
    TaskPhase.LOADED: "has loaded the car at {where}",
    TaskPhase.DONE: "has {what} the car: {where}",
    TaskPhase.REFUSED: "refuses the car at {where}",
    TaskPhase.FORFEITED: "gives the task up at {where}",
}

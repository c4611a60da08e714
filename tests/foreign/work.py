"""A robot's work on one alley: what it costs, the plan, and how far it is (chapters 4, 6 and 7 of docs/protocol.md)."""

from dataclasses import dataclass, field, replace

from tests.foreign.site import Alley, index_of, side_of
from tests.foreign.words import Signals

Task = tuple[int, int]
_ANY = 65535


@dataclass
class Call:
    """A call that is whole, and what I make of it. Times in us."""

    initiator: int
    number: int
    task: Task
    operation: str
    deadline_us: int
    deadline_ms: int
    from_station: int
    to_station: int
    car: Task
    wheelbase_mm: int
    heard_us: int
    ready_us: int = 0
    due_us: int | None = None
    steps: tuple["Step", ...] = ()
    cost_us: int = 0
    floor_us: int = 0
    best: tuple[int, int] | None = None
    has_bid: bool = False


@dataclass(frozen=True)
class Step:
    """One leg with its planned times; ``call`` where it is work, ``takes`` whether that is taking the car."""

    action: str
    begin: int
    end: int
    begin_us: int
    end_us: int
    station: int = 0
    takes: bool = False
    call: Call | None = None

    def shifted(self, by_us: int) -> "Step":
        """The same, later."""
        return replace(self, begin_us=self.begin_us + by_us, end_us=self.end_us + by_us)


@dataclass
class Program:
    """The firm itinerary and the step in hand, the first of ``steps``; ``told`` are the legs as told last."""

    alley: Alley
    steps: list[Step] = field(default_factory=list)
    version: int = 0
    stamp: tuple[int, int, int] = (0, 0, 0)
    told: int = 0
    words: list[tuple[str, Signals]] = field(default_factory=list)

    @property
    def leg(self) -> int:
        """Number of the leg in hand in what was told."""
        return max(0, self.told - max(1, len(self.steps)))

    def publish(self, place: int, now_us: int) -> list[tuple[str, Signals]]:
        """Tell it under the next version (P1, P2, J5)."""
        self.version = self.version % 255 + 1
        steps = list(self.steps) or [Step("STAND", place, place, now_us, now_us + 1000)]
        award_ms, initiator, call = self.stamp
        if not self.steps:
            award_ms = -(-now_us // 1000)
        if steps[0].action == "TRAVEL" and steps[0].begin_us > award_ms * 1000 + 10_000:
            first = steps[0]
            steps.insert(0, Step("STAND", first.begin, first.begin, first.begin_us, first.begin_us))
        stamp = {"stamp_award_ms": award_ms % 2**32, "stamp_initiator": initiator, "stamp_call": call}
        head = {"version": self.version, "grade": "FIRM", "legs": len(steps), **stamp}
        self.words = [("ItineraryHead", head)]
        self.words += [("ItineraryLeg", self._leg(n, one, award_ms)) for n, one in enumerate(steps)]
        self.told = len(steps)
        return self.words

    def _leg(self, number: int, step: Step, award_ms: int) -> Signals:
        side = side_of(step.station) if step.action == "WORK" else "NEAR"
        line = {"track": self.alley.track, "from_index": step.begin, "to_index": step.end}
        end_ms = max(0, -(-step.end_us // 1000) - award_ms)
        return {"version": self.version, "action": step.action, "leg": number, "side": side, **line, "end_ms": end_ms}

    def shift(self, by_us: int) -> None:
        """All that is left comes later."""
        self.steps = [step.shifted(by_us) for step in self.steps]

    def free_from(self, place: int, now_us: int) -> tuple[list[Step], int, int]:
        """What is kept of it for another task: up to the last work, or the run in hand; where and when that ends."""
        works = [number for number, step in enumerate(self.steps, 1) if step.action == "WORK"]
        kept = works[-1] if works else int(bool(self.steps) and self.steps[0].action == "TRAVEL")
        if not kept:
            return [], place, now_us
        last = self.steps[kept - 1]
        return self.steps[:kept], last.end, max(last.end_us, now_us)

    def go_home(self, place: int, now_us: int) -> None:
        """Behind the run in hand to the refuge, without work."""
        end, us = (self.steps[-1].end, self.steps[-1].end_us) if self.steps else (place, now_us)
        _go(self.alley, self.steps, end, self.alley.home, max(us, now_us))

    def works(self) -> list[Step]:
        """Work in hand."""
        return [step for step in self.steps if step.action == "WORK"]


def solve(alley: Alley, call: Call, place: int, from_us: int, free: list[int]) -> tuple[tuple[Step, ...], int] | None:
    """The soonest way to do a task from standing before ``place``: its steps, and when it is over."""
    ends = [(call.from_station, call.to_station)]
    if call.to_station == _ANY:
        ends = [(call.from_station, station) for station in free]
    found = [_way(alley, call, place, max(from_us, call.deadline_us + 150_000), *one) for one in ends]
    return min(found, key=lambda one: one[1], default=None)


def least_us(alley: Alley, call: Call) -> int:
    """B3: the floor of a call, of a robot before the car, over all places."""
    best = solve(alley, call, index_of(call.from_station), 0, list(alley.places))
    assert best is not None
    return best[1]


def _way(alley: Alley, call: Call, place: int, us: int, source: int, sink: int) -> tuple[tuple[Step, ...], int]:
    steps: list[Step] = []
    over_us = 0
    opened_us = call.deadline_us - alley.call_us + 9_500_000 + alley.door_us
    for station, takes in ((source, True), (sink, False)):
        us = _go(alley, steps, place, index_of(station), us)
        place = index_of(station)
        ready_us = (call.ready_us or opened_us) if station == source == alley.bay else call.ready_us
        if station == alley.bay and us < ready_us:
            steps.append(Step("STAND", place, place, us, ready_us))
            us = ready_us
        end_us = us + alley.handling_us(station)
        steps.append(Step("WORK", place, place, us, end_us, station, takes, call))
        us = over_us = end_us
    if place == index_of(alley.bay):
        _go(alley, steps, place, alley.home, us)
    return tuple(steps), over_us


def _go(alley: Alley, steps: list[Step], begin: int, end: int, us: int) -> int:
    if begin == end:
        return us
    end_us = us + alley.run_us(end - begin)
    steps.append(Step("TRAVEL", begin, end, us, end_us))
    return end_us

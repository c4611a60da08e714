"""What the fleet bus tells of a cell: goals, contracts, moves; the paper's printed answer is made of nothing else."""

from dataclasses import dataclass, field

from bus_sim.systems.cell.text import printed
from onboard.contract.cell import (
    ArmProgress,
    GoalEnd,
    GoalStart,
    MoveCostHigh,
    MoveCostLow,
    MoveFrom,
    MoveTo,
    OfferHigh,
    OfferLow,
)
from onboard.contract.codes import CallResult, TaskPhase
from onboard.contract.messages import Message, Reference
from onboard.history.calls import CallAnswered, CallOpened
from onboard.history.history import History
from onboard.history.tasks import TaskTold
from onboard.systems.cell.fields import from_halves
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.site import Cell

_ORIGIN = Point(0, 0)


@dataclass
class Told:
    """What was said of one goal or sub-goal."""

    start: Point = _ORIGIN
    end: Point = _ORIGIN
    contractor: int = 0
    position: Point = _ORIGIN
    via: Point = _ORIGIN
    own_high: int = 0
    own_cost: float = 0.0
    cost: float = 0.0
    phase: TaskPhase = TaskPhase.OPEN


@dataclass
class CellView:
    """Feed it every message of the fleet bus; ``goal_messages`` counts calls for goals and sub-goals (row C13)."""

    site: Cell
    goals: dict[Reference, Told] = field(default_factory=dict)
    positions: dict[int, ArmProgress] = field(default_factory=dict)
    goal_messages: int = 0
    deepest: int = 0
    _history: History = field(init=False)
    _highs: dict[tuple[int, Reference], int] = field(default_factory=dict)
    _offers: dict[tuple[int, Reference], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._history = History(self.site, is_bounded=False)

    def feed(self, message: Message, time_us: int = 0) -> None:
        """Take up one message of the fleet bus."""
        match self._history.feed(message, time_us):
            case CallOpened(call):
                self.goal_messages += 1
                self.deepest = max(self.deepest, call.terms.depth)
            case CallAnswered(award=award) if award.result is CallResult.AWARDED:
                told = self.goals.setdefault(award.task, Told())
                told.contractor = award.winner
                told.cost = self._offers.get((award.winner, award.task), 0.0)
            case TaskTold(report=report):
                self.goals.setdefault(report.task, Told()).phase = report.phase
        match message:
            case GoalStart():
                self._goal(message.sender, message.goal).start = Point(message.x_mm, message.y_mm)
            case GoalEnd():
                self._goal(message.sender, message.goal).end = Point(message.x_mm, message.y_mm)
            case OfferHigh():
                self._highs[message.sender, Reference(message.manager, message.goal)] = message.bits
            case OfferLow():
                key = (message.sender, Reference(message.manager, message.goal))
                self._offers[key] = from_halves(self._highs.get(key, 0), message.bits)
            case ArmProgress():
                self.positions[message.sender] = message
            case MoveFrom() | MoveTo() | MoveCostHigh() | MoveCostLow():
                self._move(message)

    def chain(self, task: Reference) -> list[Told]:
        """A goal and its sub-goals as they were awarded, in the order of carrying; empty where nobody has it."""
        found: list[Told] = []
        told = self.goals.get(task)
        while told is not None and told.contractor and told not in found:
            found.append(told)
            if told.via == told.end:
                break
            contractor, via = told.contractor, told.via
            below = (one for name, one in self.goals.items() if name.origin == contractor and one.start == via)
            told = next((one for one in below if one.contractor), None)
        return found

    def text(self, task: Reference) -> str:
        """The paper's printed answer for one goal (row C21)."""
        chain = self.chain(task)
        steps = [
            (self.site.machines[one.contractor].name, one.position, one.start, one.via, one.own_cost) for one in chain
        ]
        return printed(steps, chain[0].cost if chain else 0.0)

    def _goal(self, manager: int, number: int) -> Told:
        return self.goals.setdefault(Reference(manager, number), Told())

    def _move(self, message: MoveFrom | MoveTo | MoveCostHigh | MoveCostLow) -> None:
        told = self._goal(message.manager, message.goal)
        match message:
            case MoveFrom():
                told.position = Point(message.x_mm, message.y_mm)
            case MoveTo():
                told.via = Point(message.x_mm, message.y_mm)
            case MoveCostHigh():
                told.own_high = message.bits
            case MoveCostLow():
                told.own_cost = from_halves(told.own_high, message.bits)

"""What vehicles, lanes and boxes of a terminal say: the part of the history that this system has of its own."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard.contract.messages import Message
from onboard.contract.terminal import LaneState, PlanHead, PlanStep, StepReport, StepResult
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.terminal.site import Terminal


@dataclass
class VehicleSeen:
    """One vehicle: its plan as far as it was told, the step that it is at, and the entity where it does that."""

    entity: int
    version: int | None = None
    begin_ms: int = 0
    count: int = 0
    steps: dict[int, PlanStep] = field(default_factory=dict)
    current: int = 0
    #: Entities left behind since the history began.
    passed: int = 0
    is_driving: bool = False

    @property
    def step(self) -> PlanStep | None:
        """The step in hand, where it was told."""
        return self.steps.get(self.current)

    def to_come(self) -> Iterator[PlanStep]:
        """The steps from the one in hand on, as far as they were told."""
        return (self.steps[number] for number in range(self.current, self.count) if number in self.steps)


@dataclass(frozen=True, slots=True)
class RouteTold(SystemFact):
    """A vehicle has another plan; one that begins when the old one began goes on where that was."""

    node: int
    goes_on: bool


@dataclass(frozen=True, slots=True)
class LegTold(SystemFact):
    """One step of a vehicle's plan."""

    step: PlanStep


@dataclass(frozen=True, slots=True)
class StepTold(SystemFact):
    """A vehicle reports a step of its plan; ``left`` is the entity where it was before.

    ``is_news``: it is the first word that this step is done.
    """

    report: StepReport
    left: int
    is_news: bool


@dataclass(frozen=True, slots=True)
class LaneTold(SystemFact):
    """Whether a lane can be passed; ``is_news``: it is otherwise than it was told before."""

    word: LaneState
    is_news: bool


class TerminalHistory(SystemHistory):
    """A fold over plans, reports and lanes."""

    def __init__(self, site: Terminal, tasks: TaskFold) -> None:
        super().__init__(tasks)
        self._site = site
        self.vehicles = {node: VehicleSeen(site.machines[node].home.track) for node in site.vehicles}
        self.blocked: dict[int, bool] = {}

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Follow lanes, plans, and the steps done of them; words about an older plan count for nothing."""
        if isinstance(message, LaneState):
            is_news = self.blocked.get(message.lane, False) is not message.blocked
            self.blocked[message.lane] = message.blocked
            return LaneTold(message, is_news)
        vehicle = self.vehicles.get(message.sender)
        if vehicle is None:
            return None
        match message:
            case PlanHead() if message.version != vehicle.version:
                return _on_head(vehicle, message)
            case PlanStep() if message.version == vehicle.version and message.entity in self._site.entities:
                vehicle.steps[message.step] = message
                return LegTold(message)
            case StepReport() if message.version == vehicle.version:
                return _on_report(vehicle, message)
        return None


def _on_head(vehicle: VehicleSeen, head: PlanHead) -> RouteTold:
    goes_on = vehicle.version is not None and head.begin_ms == vehicle.begin_ms
    vehicle.version, vehicle.begin_ms, vehicle.count, vehicle.steps = head.version, head.begin_ms, head.steps, {}
    vehicle.current = vehicle.current if goes_on else 0
    return RouteTold(head.sender, goes_on)


def _on_report(vehicle: VehicleSeen, report: StepReport) -> StepTold:
    fact = StepTold(report, vehicle.entity, report.result is StepResult.DONE and report.step >= vehicle.current)
    if report.result is not StepResult.DONE:
        vehicle.is_driving = False
    if fact.is_news:
        vehicle.current = report.step + 1
        vehicle.entity = vehicle.step.entity if vehicle.step is not None else report.entity
        vehicle.passed += vehicle.entity != fact.left
        vehicle.is_driving = vehicle.current < vehicle.count
    return fact


def terminal_history(history: History) -> TerminalHistory:
    """A terminal's part of a history of its bus."""
    assert isinstance(history.system, TerminalHistory), "the site is a terminal"
    return history.system


HISTORY = TerminalHistory

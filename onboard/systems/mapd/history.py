"""What robots of a floor of cells say: the part of the history that this system has of its own."""

from dataclasses import dataclass

from onboard.contract.mapd import PathHead, PathMoves, StepState, StepTurn
from onboard.contract.messages import Message
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.mapd.moves import Assembly
from onboard.systems.mapd.site import Mapd


@dataclass(frozen=True, slots=True)
class CellTold(SystemFact):
    """A robot of the site says in which cell of the floor it is at a step."""

    word: StepState


@dataclass(frozen=True, slots=True)
class TurnTold(SystemFact):
    """How a robot's turn in a round of calls ended."""

    word: StepTurn


class MapdHistory(SystemHistory):
    """A fold over steps, turns and paths."""

    def __init__(self, site: Mapd, tasks: TaskFold) -> None:
        super().__init__(tasks)
        self._site = site
        self.cells = dict(site.homes)
        #: Cells that each robot has left behind.
        self.passed = dict.fromkeys(site.homes, 0)
        #: Each robot's newest path, as far as it was heard.
        self.paths: dict[int, Assembly] = {}

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Follow robots of the site, their paths in parts, and turns that were lost."""
        if isinstance(message, StepTurn):
            return TurnTold(message)
        if message.sender not in self.cells:
            return None
        match message:
            case StepState() if message.cell < self._site.floor.size:
                self.passed[message.sender] += message.cell != self.cells[message.sender]
                self.cells[message.sender] = message.cell
                return CellTold(message)
            case PathHead():
                self.paths[message.sender] = Assembly(message)
            case PathMoves():
                if message.sender in self.paths:
                    self.paths[message.sender].take(message)
        return None


def mapd_history(history: History) -> MapdHistory:
    """A floor's part of a history of its bus."""
    assert isinstance(history.system, MapdHistory), "the site is a floor of cells"
    return history.system


HISTORY = MapdHistory

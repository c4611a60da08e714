"""What arms say of parts, goals and moves: the part of the history that this system has of its own."""

from collections import OrderedDict
from dataclasses import dataclass
from typing import TypeVar

from onboard.contract.cell import ArmProgress, GoalEnd, GoalStart, MoveFrom, MoveTo, PartAt
from onboard.contract.messages import Message, Reference
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.cell.site import Cell

#: Goals and parts that are remembered: the newest.
MOST_KEPT = 256
_Key = TypeVar("_Key")
_Value = TypeVar("_Value")
#: x and y in mm.
_Spot = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ArmTold(SystemFact):
    """An arm says where its tool is and what it does."""

    word: ArmProgress


@dataclass(frozen=True, slots=True)
class PartTold(SystemFact):
    """Who has a part says where it is; ``is_news``: somebody else carries it than before, or it was not heard of."""

    word: PartAt
    is_news: bool
    is_first: bool


@dataclass(frozen=True, slots=True)
class MoveTold(SystemFact):
    """A robot says from where it will bring a part, or to where, for one goal of ``manager``; x and y in mm."""

    robot: int
    manager: int
    goal: int
    start: _Spot | None
    end: _Spot | None


class CellHistory(SystemHistory):
    """A fold over words of arms and managers."""

    def __init__(self, site: Cell, tasks: TaskFold) -> None:
        super().__init__(tasks)
        #: Where goals begin and end, by manager and number.
        self.starts: OrderedDict[tuple[int, int], _Spot] = OrderedDict()
        self.ends: OrderedDict[tuple[int, int], _Spot] = OrderedDict()
        #: Where parts are, and who carries them, 0 for nobody.
        self.parts: OrderedDict[Reference, tuple[_Spot, int]] = OrderedDict()

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Follow arms, parts, goals, and the moves that robots promise."""
        match message:
            case ArmProgress():
                return ArmTold(message)
            case GoalStart():
                _keep(self.starts, (message.sender, message.goal), (message.x_mm, message.y_mm))
            case GoalEnd():
                _keep(self.ends, (message.sender, message.goal), (message.x_mm, message.y_mm))
            case PartAt():
                return self._on_part(message)
            case MoveFrom():
                return MoveTold(message.sender, message.manager, message.goal, (message.x_mm, message.y_mm), None)
            case MoveTo():
                return MoveTold(message.sender, message.manager, message.goal, None, (message.x_mm, message.y_mm))
        return None

    def _on_part(self, word: PartAt) -> PartTold:
        carrier = word.sender if word.aboard else 0
        known = self.parts.get(word.part)
        _keep(self.parts, word.part, ((word.x_mm, word.y_mm), carrier))
        return PartTold(word, known is None or known[1] != carrier, known is None)


def _keep(kept: OrderedDict[_Key, _Value], key: _Key, value: _Value) -> None:
    """The newest at the end; the oldest goes when there are too many."""
    kept[key] = value
    kept.move_to_end(key)
    if len(kept) > MOST_KEPT:
        kept.popitem(last=False)


def cell_history(history: History) -> CellHistory:
    """A cell's part of a history of its bus."""
    assert isinstance(history.system, CellHistory), "the site is a cell"
    return history.system


HISTORY = CellHistory

"""What lathes say of orders and prices: the part of the history that this system has of its own."""

from collections import OrderedDict
from dataclasses import dataclass

from onboard.contract.messages import Message, Reference
from onboard.contract.turning import BillBar, LathePhase, LatheProgress
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.turning.site import Turning

#: Prices that are remembered: the newest.
MOST_KEPT = 256


@dataclass(frozen=True, slots=True)
class ProgressTold(SystemFact):
    """A lathe of the site says how far an order is; ``is_news``: it is in another phase than before."""

    task: Reference
    word: LatheProgress
    is_news: bool


class TurningHistory(SystemHistory):
    """A fold over progress and bills."""

    def __init__(self, site: Turning, tasks: TaskFold) -> None:
        super().__init__(tasks)
        #: By lathe and order, those that are not finished.
        self.progress: dict[int, OrderedDict[Reference, LatheProgress]] = {node: OrderedDict() for node in site.lathes}
        #: What a part costs by who bids, and the order, ct.
        self.prices: dict[tuple[int, Reference], int] = {}

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Follow prices in bills, and orders until they are finished."""
        match message:
            case BillBar():
                self.prices[message.sender, Reference(message.manager, message.task)] = message.total_ct
                if len(self.prices) > MOST_KEPT:
                    del self.prices[next(iter(self.prices))]
            case LatheProgress() if message.sender in self.progress:
                return self._on_progress(message)
        return None

    def _on_progress(self, word: LatheProgress) -> ProgressTold:
        task, row = Reference(word.manager, word.task), self.progress[word.sender]
        known = row.get(task)
        row[task] = word
        if word.lathe_phase is LathePhase.FINISHED:
            del row[task]
        return ProgressTold(task, word, known is None or known.lathe_phase is not word.lathe_phase)


def turning_history(history: History) -> TurningHistory:
    """A turning cell's part of a history of its bus."""
    assert isinstance(history.system, TurningHistory), "the site is a turning cell"
    return history.system


HISTORY = TurningHistory

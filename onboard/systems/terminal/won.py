"""Whether what was won is still its winner's, as far as a desk sees: a box in a plan, or where it was to come."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.messages import Reference
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.missions import MissionBook

#: A task that was won and is in no plan for so long is called anew, us: its winner gave it up or lost it.
LOST_US = 120_000_000
#: As long where its box is in a plan for another desk's task, us: who has won it as well gives it up in its next turn,
#: and its word for that may have been missed. Ours: more than two of ``planner.SAY_US``.
ANOTHERS_US = 12_000_000


@dataclass
class WonBoxes:
    """Since when nothing shows that whoever has won a task has it."""

    node_id: int
    orders: MissionBook
    mirror: TerminalMirror
    _shown_at_us: dict[Reference, int] = field(default_factory=dict)
    #: Tasks whose boxes others were seen to be carried for.
    _anothers: set[Reference] = field(default_factory=set)

    def show(self, tasks: Iterable[Reference], now_us: int) -> None:
        """These were won, or their winners say again that they have them."""
        self._shown_at_us |= dict.fromkeys(tasks, now_us)

    def over(self, task: Reference) -> None:
        """Done, given back, or taken back."""
        self._shown_at_us.pop(task, None)
        self._anothers.discard(task)

    def is_done(self, task: Reference) -> bool:
        """Whether its box has come; of those wanted by their type not one that came for another desk's mission."""
        transport = self.orders.open[task]
        is_there = self.mirror.station_of(transport.box) == transport.target
        return is_there and not (transport.type and task in self._anothers)

    def is_anothers(self, task: Reference) -> bool:
        """Whether its box was seen in a plan for a task that another desk calls for."""
        return task in self._anothers

    def is_lost(self, task: Reference, now_us: int) -> bool:
        """Whether its box has been in no plan for it for too long."""
        load = self.mirror.load_of(self.orders.open[task].box)
        if load is not None and load.task.origin != self.node_id and load.task not in self.orders.open:
            self._anothers.add(task)
        elif load is not None:
            self._anothers.discard(task)
            self._shown_at_us[task] = now_us
        patience_us = ANOTHERS_US if task in self._anothers else LOST_US
        return now_us - self._shown_at_us.get(task, now_us) >= patience_us

"""Which open tasks begin near where another ends: what tells a bidder which work leads on to other work.

Kept by counts at cells, so that a task that comes or goes costs what lies within ``RANGE`` of its ends, however many
tasks are open. The counts are those of the open tasks alone, whatever the order in which they came.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.tasks import TransportTask

#: Steps: what is no nearer than this counts as this far (6 and 10 came out alike).
RANGE = 6
#: A pick-up is well reached within the steps within which so many other open tasks end.
ENDS = 4


def _ends(task: TransportTask) -> tuple[int, int]:
    return task.pickup, task.delivery


def _counts() -> defaultdict[int, list[int]]:
    return defaultdict(lambda: [0] * RANGE)


@dataclass
class Nearby:
    """The open tasks of one floor as one robot knows them; ``see`` says which they are now."""

    floor: Floor
    _open: dict[int, TransportTask] = field(default_factory=dict)
    #: How many open tasks begin 0, 1, ... steps from a cell, and how many end so many steps before a pick-up's cell.
    _begin: defaultdict[int, list[int]] = field(default_factory=_counts)
    _end: defaultdict[int, list[int]] = field(default_factory=_counts)
    #: By pick-up: the cells from which it is near, and in how many steps; by cell, the pick-ups that are near it.
    _before: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    _after: defaultdict[int, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))
    #: How many open tasks end in a cell.
    _ends_in: defaultdict[int, int] = field(default_factory=lambda: defaultdict(int))
    #: Open tasks that begin so near to where they end that they count themselves, by number.
    _close: set[int] = field(default_factory=set)
    #: ``onward`` by where a task ends and ``reached`` by where it begins, of all others, while counts are the same.
    _onward: dict[int, int] = field(default_factory=dict)
    _reached: dict[int, int] = field(default_factory=dict)

    def see(self, tasks: Iterable[TransportTask]) -> None:
        """These are open now: what is gone is taken out, what came is put in."""
        before, self._open = self._open, {task.number: task for task in tasks}
        changed = [
            number
            for number, task in self._open.items()
            if (known := before.get(number)) is not task and (known is None or _ends(known) != _ends(task))
        ]
        for number in [*(before.keys() - self._open.keys()), *(before.keys() & changed)]:
            self._close.discard(number)
            self._count(*_ends(before[number]), -1)
        for number in changed:
            pickup, delivery = _ends(self._open[number])
            if self.floor.steps_to(pickup)[delivery] < RANGE:
                self._close.add(number)
            self._count(pickup, delivery, 1)

    def dearer(self, task: TransportTask) -> int:
        """Steps by which an open task is a worse choice than others: what it leads to, and who else will come by."""
        if task.number in self._close:
            return self.onward(task) + RANGE - self.reached(task)
        onward, reached = self._onward.get(task.delivery), self._reached.get(task.pickup)
        if onward is None:
            onward = self._onward[task.delivery] = self.onward(task)
        if reached is None:
            reached = self._reached[task.pickup] = self.reached(task)
        return onward + RANGE - reached

    def onward(self, task: TransportTask) -> int:
        """Steps from where an open task ends to where the nearest other one begins, ``RANGE`` at most."""
        own = self.floor.steps_to(task.pickup)[task.delivery]
        for steps, count in enumerate(self._begin[task.delivery]):
            if count > (steps == own):
                return steps
        return RANGE

    def reached(self, task: TransportTask) -> int:
        """Steps to where an open task begins within which ``ENDS`` others end, ``RANGE`` at most."""
        own, found = self.floor.steps_to(task.pickup)[task.delivery], 0
        for steps, count in enumerate(self._end[task.pickup]):
            found += count - (steps == own)
            if found >= ENDS:
                return steps
        return RANGE

    def _count(self, pickup: int, delivery: int, by: int) -> None:
        if pickup not in self._before:
            self._survey(pickup)
        for cell, steps in self._before[pickup]:
            self._begin[cell][steps] += by
            self._onward.pop(cell, None)
        self._ends_in[delivery] += by
        for other, steps in self._after[delivery]:
            self._end[other][steps] += by
            self._reached.pop(other, None)

    def _survey(self, pickup: int) -> None:
        """A pick-up that was not seen before: what is near it, and what ends there by now."""
        self._before[pickup] = self.floor.near_to(pickup, RANGE)
        self._reached.pop(pickup, None)
        for cell, steps in self._before[pickup]:
            self._after[cell].append((pickup, steps))
            self._end[pickup][steps] += self._ends_in[cell]

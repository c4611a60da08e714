"""Cars that nobody could fetch: their tickets wait behind those of others, and keep no bay for themselves.

A lift is out, or a way is blocked: nobody knows when such a car will be fetched, and whoever waits for another at the
same bay, or outside with one to park, would wait as long. Source: decisions.md, "A car that nobody can fetch".
"""

from collections.abc import Collection
from dataclasses import dataclass, field

from onboard.contract.messages import Reference
from onboard.systems.car_park.bay_task import BayTask
from onboard.ways.mirror import WayMirror
from onboard.ways.told_way import has_work

#: So often nobody can take a car to be parked while robots are at work before its driver is told to take it back: after
#: some two minutes (``bay_task.RETRY_US``), in which a robot is through with a task.
MOST_PUT_OFF = 2


def is_put_off(task: BayTask, mirror: WayMirror) -> bool:
    """Whether nobody could take a task though robots are at work: their plans may be full, and have room soon."""
    plans = (plan for node, plan in mirror.itineraries.items() if node not in mirror.obstacles.machines)
    return task.refusals <= MOST_PUT_OFF and any(has_work(plan) for plan in plans)


@dataclass
class InVain:
    """One compartment's tasks that nobody could do, each kept for its next call."""

    _tasks: dict[Reference, BayTask] = field(default_factory=dict)

    @property
    def is_any(self) -> bool:
        """Whether some car could not be fetched, and its owner may still wait."""
        return bool(self._tasks)

    def put(self, task: BayTask, tickets: Collection[Reference]) -> None:
        """Nobody could once more; of cars that nobody waits for any more nothing is kept."""
        self._tasks = {car: one for car, one in self._tasks.items() if car in tickets}
        self._tasks[task.car] = task

    def over(self, car: Reference) -> None:
        """Somebody has won to fetch it, or another bay is to."""
        self._tasks.pop(car, None)

    def task(self, car: Reference) -> BayTask | None:
        """The task that nobody could do for a car; None for one that nobody was called for in vain."""
        return self._tasks.get(car)

    def waits(self, car: Reference, now_us: int) -> bool:
        """Whether it is not to be called for yet."""
        task = self._tasks.get(car)
        return task is not None and task.retry_at_us is not None and task.retry_at_us > now_us

    def may_be_served(self, now_us: int) -> None:
        """A robot has come back, or is done: all are called for as soon as it may bid."""
        for task in self._tasks.values():
            task.may_be_served(now_us)

    def next_wake(self, after_us: int) -> int | None:
        """When the next is called for, of those times that nobody has looked at yet, bus us."""
        due = (task.retry_at_us for task in self._tasks.values() if task.retry_at_us is not None)
        return min((due_us for due_us in due if due_us > after_us), default=None)

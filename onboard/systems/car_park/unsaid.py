"""Cars that a robot took away to park, of which nobody has said that they are parked.

A robot that loses its journal forgets the task, and leaves the car all the same. Whoever called for it sees where the
car stands, and says itself that this is done: else the order would be under way for ever.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, Reason, TaskPhase
from onboard.contract.messages import Reference, TaskReport
from onboard.core.effects import Effect, Send
from onboard.systems.car_park import bay_task, custody
from onboard.ways.mirror import WayFleet

#: Who has left a car says so with the word where it stands; who was started again right then within this, us.
SAID_WITHIN_US = 15_000_000


@dataclass
class UnsaidParkings:
    """One compartment's, since its start; what was under way before is its robots' to say."""

    fleet: WayFleet
    #: By task the car, and since when it stands at a place, bus us.
    _taken: dict[Reference, Reference] = field(default_factory=dict)
    _since_us: dict[Reference, int] = field(default_factory=dict)

    def begins(self, task: Reference, car: Reference) -> None:
        """A robot has the car."""
        self._taken[task] = car

    def hear(self, report: TaskReport) -> None:
        """Its robot says that it is done, or it is nobody's task any more."""
        if report.phase in (TaskPhase.DONE, TaskPhase.REFUSED):
            self._end(report.task)

    def review(self, now_us: int) -> list[Effect]:
        """Say it of those that stand at their places for long enough."""
        effects: list[Effect] = []
        for task, car in list(self._taken.items()):
            place = custody.place_of(self.fleet, car)
            if bay_task.is_gone(car, self.fleet.mirror):
                self._end(task)
            elif place is None or self._is_with_robot(car):
                self._since_us.pop(task, None)
            elif now_us >= self._since_us.setdefault(task, now_us) + SAID_WITHIN_US:
                self._end(task)
                done = TaskReport(self.fleet.node_id, task, TaskPhase.DONE, place.number, Reason.NONE)
                effects.append(Send(done))
        return effects

    def next_wake(self) -> int | None:
        """When one is to be said, bus us."""
        return min((since_us + SAID_WITHIN_US for since_us in self._since_us.values()), default=None)

    def _is_with_robot(self, car: Reference) -> bool:
        record = self.fleet.mirror.cars.get(car)
        machine = None if record is None else self.fleet.site.machines.get(record.custodian)
        return machine is None or machine.kind is KindCode.ROBOT

    def _end(self, task: Reference) -> None:
        self._taken.pop(task, None)
        self._since_us.pop(task, None)

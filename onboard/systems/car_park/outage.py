"""Who waits at the desk for a robot that does not come hears so: it stands, and a person may need hours to mend it."""

from collections import deque
from dataclasses import dataclass, field

from onboard.contract.codes import DeskText, KindCode, Operation
from onboard.contract.messages import Reference
from onboard.core.effects import Effect
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_task import BayPhase
from onboard.systems.car_park.outputs import BayOutputs
from onboard.ways.mirror import WayFleet

#: Who is an obstacle for so long does not come soon, us: a restart takes 10 s, and two in a row have taken 30 s.
OUT_AFTER_US = 30_000_000
#: In these the bay waits for a robot.
_WAITS = (BayPhase.LOCKING, BayPhase.AWAITING, BayPhase.OPENING, BayPhase.SERVING)


@dataclass
class Outage:
    """One compartment's. ``tickets`` are those that wait behind the task that has the bay; times are bus us."""

    fleet: WayFleet
    calls: BayCalls
    outputs: BayOutputs
    tickets: deque[Reference]
    _told: set[Reference] = field(default_factory=set)

    def review(self, phase: BayPhase, now_us: int) -> list[Effect]:
        """Tell each who waits once that nobody comes, and again that it is to be waited for once somebody may."""
        waiting = self._waiting()
        due_us = self._due_us(phase)
        if due_us is None or now_us < due_us:
            again = [car for car in waiting if car in self._told and not self._is_being_served(car)]
            self._told.clear()
            return [self.outputs.show(DeskText.PLEASE_WAIT, car) for car in again]
        # Who puts the ticket in again reads first that it was taken.
        asks = self.outputs.shown
        untold = [car for car in waiting if car not in self._told or asks == (DeskText.PLEASE_WAIT, car)]
        self._told.update(untold)
        return [self.outputs.show(DeskText.OUT_OF_ORDER, car) for car in untold]

    def next_wake(self, phase: BayPhase) -> int | None:
        """When those who wait are to be told, bus us; None where they were, or none waits, or a robot may come."""
        due_us = self._due_us(phase)
        return due_us if due_us is not None and any(car not in self._told for car in self._waiting()) else None

    def _waiting(self) -> list[Reference]:
        job = self.calls.job
        asked = [] if job is None or job.operation is not Operation.RETRIEVE else [job.car]
        return [*asked, *self.tickets]

    def _is_being_served(self, car: Reference) -> bool:
        """Whether its robot has had the bay: the next that its customer reads is that it is ready."""
        job = self.calls.job
        return job is not None and job.car == car and job.was_granted

    def _due_us(self, phase: BayPhase) -> int | None:
        """From when on nobody comes: the robot that has the task stands, or where none has it, all of the site."""
        job, obstacles = self.calls.job, self.fleet.mirror.obstacles.machines
        if job is None or phase not in _WAITS:
            return None
        machines = self.fleet.site.machines.values()
        robots = [job.winner] if job.winner else [one.node_id for one in machines if one.kind is KindCode.ROBOT]
        if not all(node in obstacles for node in robots):
            return None
        return max((obstacles[node].since_us for node in robots), default=0) + OUT_AFTER_US

"""Who waits at the desk for a robot that does not come hears so: it stands, and a person may need hours to mend it.

So does who waits for a car that no robot can bring while some machine is out, a lift, or a way is blocked; or for one
whose robot waits for such a lift, aboard of it or at its sill.
"""

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field

from onboard.contract.codes import DeskText, LegAction, Operation
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Reference
from onboard.core.authority import segment_token
from onboard.core.effects import Effect
from onboard.core.serial import from_bus_ms
from onboard.core.site import Segment
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_task import BayPhase
from onboard.systems.car_park.outputs import BayOutputs
from onboard.ways.mirror import WayFleet

#: Who is an obstacle for so long does not come soon, us: a restart takes 10 s, and two in a row have taken 30 s.
OUT_AFTER_US = 30_000_000
#: A word about another car stands so long before the bay's own is shown again, us: time to read it, and to go.
READ_US = 15_000_000
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
    _looked_us: int = 0
    #: Since when a word about another car has stood where the bay's own, that nobody comes, did.
    _covered_us: int | None = None

    def review(self, phase: BayPhase, now_us: int) -> list[Effect]:
        """Tell each who waits once that nobody comes, and again that it is to be waited for once somebody may."""
        self._looked_us = now_us
        if self._is_nobody_out() and not self._told:
            self._covered_us = None
            return []
        due = self._due_us(phase)
        is_out = {car: due_us is not None and now_us >= due_us for car, due_us in due.items()}
        in_doubt = {car for car in self._told if car in is_out and not is_out[car] and self._is_open(car)}
        again = [
            car for car in sorted(self._told - in_doubt) if is_out.get(car) is False and not self._is_being_served(car)
        ]
        self._told = {car for car in self._told if is_out.get(car)} | in_doubt
        # Who puts the ticket in again reads first that it was taken.
        asks = self.outputs.shown
        untold = [
            car for car, out in is_out.items() if out and (car not in self._told or asks == (DeskText.PLEASE_WAIT, car))
        ]
        self._told.update(untold)
        told = [self.outputs.show(DeskText.PLEASE_WAIT, car) for car in again]
        told += [self.outputs.show(DeskText.OUT_OF_ORDER, car) for car in untold]
        return told + self._shown_again(now_us)

    def _shown_again(self, now_us: int) -> list[Effect]:
        """Who comes to a bay that waits for nobody reads that, and not where somebody else was sent."""
        job, shown = self.calls.job, self.outputs.shown
        if job is None or job.car not in self._told or shown is None or shown[0] is DeskText.OUT_OF_ORDER:
            self._covered_us = None
            return []
        self._covered_us = now_us if self._covered_us is None else self._covered_us
        if now_us < self._covered_us + READ_US:
            return []
        self._covered_us = None
        return [self.outputs.show(DeskText.OUT_OF_ORDER, job.car)]

    def next_wake(self, phase: BayPhase) -> int | None:
        """When those who wait are to be told, bus us; None where they were, or none waits, or a robot may come."""
        covered_us = None if self._covered_us is None else self._covered_us + READ_US
        if self._is_nobody_out():
            return covered_us
        return _first(covered_us, *(due_us for car, due_us in self._due_us(phase).items() if car not in self._told))

    def _is_nobody_out(self) -> bool:
        """Whether no machine is in the way and no way blocked, so that nobody is due to be told anything."""
        obstacles = self.fleet.mirror.obstacles
        return not (obstacles.machines or obstacles.blocked)

    def _is_open(self, car: Reference) -> bool:
        """Whether nobody has won its task, or the bay's: who wins that now may give it back in a moment."""
        return any(task is not None and not task.winner for task in (self.calls.of_car(car), self.calls.job))

    def _is_being_served(self, car: Reference) -> bool:
        """Whether its robot has had the bay: the next that its customer reads is that it is ready."""
        job = self.calls.job
        return job is not None and job.car == car and job.was_granted

    def _due_us(self, phase: BayPhase) -> dict[Reference, int | None]:
        """From when on nobody comes to each who waits: who has the bay's task stands, or has his, or is before it.

        Or whose car is aboard of who stands, or where there is no way to.
        """
        if phase is BayPhase.STARTING:
            # Until its own sensors have said something it tells nobody anything.
            return {}
        job, robots = self.calls.job, self.fleet.mirror.site.robots
        fetched = [task for task in self.calls.in_hand() if task.operation is Operation.RETRIEVE]
        if job is None or phase not in _WAITS:
            out_us = self._out_from_us(robots)
            return {
                **{task.car: self._no_way_us(task.car) for task in fetched},
                **{car: _first(out_us, self._aboard_us(car), self._no_way_us(car)) for car in self.tickets},
            }
        bay_us = _first(
            self._out_from_us([job.winner] if job.winner else robots),
            self._out_from_us([self._in_front()]),
            self._rides_us(job.winner),
            self._nowhere_us(job.winner),
        )
        due = {car: _first(bay_us, self._aboard_us(car), self._no_way_us(car)) for car in self.tickets}
        for task in fetched:
            its_us = self._out_from_us([task.winner] if task.winner else robots)
            on_way_us = self._rides_us(task.winner), self._nowhere_us(task.winner)
            due[task.car] = _first(bay_us, its_us, *on_way_us, self._no_way_us(task.car))
        return due

    def _no_way_us(self, car: Reference) -> int | None:
        """When the first machine counts as out, or a way as blocked, where nobody could fetch a car."""
        if self.calls.in_vain.task(car) is None:
            return None
        return self._hindered_us()

    def _hindered_us(self) -> int | None:
        """When the first machine counts as out; long ago where a way is blocked, which a person has said."""
        obstacles = self.fleet.mirror.obstacles
        return 0 if obstacles.blocked else _first(*(one.since_us + OUT_AFTER_US for one in obstacles.machines.values()))

    def _rides_us(self, node: int) -> int | None:
        """When a lift counts as out by which a machine rides, or is to ride, on its way to the bay by its plan."""
        plan, near_us = self.fleet.mirror.itineraries.get(node), self._looked_us
        here, lifts = tuple(self.calls.station), []
        for leg in plan.legs if plan is not None else ():
            if (leg.track, leg.to_index, leg.side) == here:
                break
            # A ride that is over was over before its lift was out for so long.
            if leg.action is LegAction.RIDE and from_bus_ms(leg.end_ms, near_us) > near_us - OUT_AFTER_US:
                lifts.append(self.fleet.site.stewards[leg.track])
        return _first(*(self._out_from_us([lift]) for lift in lifts))

    def _nowhere_us(self, node: int) -> int | None:
        """When a machine counts as stuck whose plan is over and did not lead here, while something is in the way.

        That is before all its refuges, or in the only way: whoever has the task waits for it, at ease.
        """
        plan, hindered_us = self.fleet.mirror.itineraries.get(node), self._hindered_us()
        if plan is None or not plan.legs or hindered_us is None or node in self.fleet.mirror.obstacles.machines:
            return None
        if any((leg.track, leg.to_index, leg.side) == tuple(self.calls.station) for leg in plan.legs):
            return None
        return max(hindered_us, from_bus_ms(plan.legs[-1].end_ms, self._looked_us) + OUT_AFTER_US)

    def _in_front(self) -> int:
        """Who has the right to the slot in front of the bay: while it stands there nobody else comes."""
        station = self.calls.station
        return self.fleet.tokens.holder_of(segment_token(Segment(station.track, station.index)))

    def _aboard_us(self, car: Reference) -> int | None:
        """When the robot that a car is aboard of counts as out."""
        known = self.fleet.mirror.cars.get(car)
        if known is None or known.station != ANY_STATION:
            return None
        return self._out_from_us([known.custodian])

    def _out_from_us(self, nodes: Collection[int]) -> int | None:
        """When all of these are known not to come, or go, soon; None where one of them may."""
        obstacles = self.fleet.mirror.obstacles.machines
        if not all(node in obstacles for node in nodes):
            return None
        return max((obstacles[node].since_us for node in nodes), default=0) + OUT_AFTER_US


def _first(*times_us: int | None) -> int | None:
    return min((one for one in times_us if one is not None), default=None)

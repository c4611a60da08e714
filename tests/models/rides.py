"""What moves when a robot rides a lift: a carrier and a platform whose motion takes its time, and the robot's plan.

A body sets off, is half way, and arrives, while other machines do what they like; whose controller orders it no more
stands where it is. Each robot has the alleys of its own ride to itself, so that only gate and platform are to be won.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import DriveMode, LegAction, ShuttleMode, Side
from onboard.contract.messages import DriveOrder, DriveState, Message, PlatformState, ShuttleState
from onboard.core.behaviour import Behaviour
from onboard.core.mirror import Mirror
from onboard.core.site import Machine, Segment, Site
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.program import CarStep, Program, StationWork
from onboard.systems.car_park.robot import ParkingRobot, ParkingRobotFactory
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.lifts import lift_at, lift_index_of
from onboard.ways.mirror import way_mirror
from tests.models.at_work import Body
from tests.models.snapshot import NOW_US, WHILE_US

#: Begin and end of each step, us: the same bus ms as an hour from now, and never late.
_BEGIN_US = NOW_US + (1 << 32) * 1000
_END_US = _BEGIN_US + 3_600_000_000
_NOWHERE = Segment(0, 0)
#: So many plans of one life have begins of their own.
_PLANS = 16


class AxisState(NamedTuple):
    """Where a drive is, in mm, where it is on its way to (None at rest), its last order, and by which floor it goes."""

    position_mm: int
    target_mm: int | None = None
    sequence: int = 0
    floor: int = 0


class Felt(NamedTuple):
    """What a platform's sensors see of the robots."""

    aboard: bool
    crossing: bool


#: What a body does by itself.
GOES_ON = "goes on"


@dataclass
class AxisBody(Body):
    """One drive: half way once, then there."""

    node: int
    now: AxisState
    #: Whether its controller still repeats the order, and by which floor it goes.
    is_ordered: Callable[[], bool] = bool
    floor: Callable[[], int] = int
    #: What a lift's sensors saw last.
    felt: Felt | None = None

    @property
    def state(self) -> AxisState:
        """Where it is, and where it is on its way to."""
        return self.now

    def start(self) -> list[Message]:
        """While its controller was off it has come to a stand."""
        self.now = self.now._replace(target_mm=None)
        return [self._drive()]

    def _drive(self) -> DriveState:
        now = self.now
        rests = now.target_mm is None
        mode, speed_mm_s = (DriveMode.STANDING, 0) if rests else (DriveMode.MOVING, 500)
        return DriveState(self.node, now.sequence, now.position_mm, speed_mm_s, mode, rests and self.is_at_mark)

    @property
    def is_at_mark(self) -> bool:
        """Whether it is not half way."""
        return True

    def order(self, order: Message) -> list[Message]:
        """It sets off, and says so."""
        if not isinstance(order, DriveOrder) or order.sequence == self.now.sequence:
            return []
        target_mm = None if order.target_mm == self.now.position_mm else order.target_mm
        self.now = self.now._replace(target_mm=target_mm, sequence=order.sequence, floor=self.floor())
        return [self._drive()]

    def meets(self, event: object) -> list[Message]:
        """It goes on, to the middle of its way and then to its end; or it feels something."""
        if isinstance(event, Felt):
            self.felt = event
            return [PlatformState(self.node, event.aboard, event.crossing, 0)]
        now = self.now
        if now.target_mm is not None:
            half_mm = (now.position_mm + now.target_mm) // 2
            if not self.is_ordered():
                self.now = now._replace(target_mm=None)
            elif self.is_at_mark:
                self.now = now._replace(position_mm=half_mm)
            else:
                self.now = now._replace(position_mm=now.target_mm, target_mm=None)
        return [self._drive()]


@dataclass
class CarrierBody(AxisBody):
    """A robot's carrier between a sill and a platform, and its shuttle, which is home."""

    pitch_mm: int = 1

    @property
    def is_at_mark(self) -> bool:
        """At the sill or on the platform."""
        return self.now.position_mm % self.pitch_mm == 0

    def start(self) -> list[Message]:
        """The shuttle tells as well."""
        return [*super().start(), ShuttleState(self.node, 0, ShuttleMode.HOME, 0, Side.NEAR, 0, 2_500)]


@dataclass
class PlatformBody(AxisBody):
    """A lift's platform."""

    stops_mm: tuple[int, ...] = ()

    @property
    def is_at_mark(self) -> bool:
        """At a floor."""
        return self.now.position_mm in self.stops_mm


@dataclass
class _TimelessProgram(Program):
    """Nobody is early or late; each plan is told anew all the same."""

    def shift(self, by_us: int) -> None:
        """To the same times."""
        self._tell_anew(self.remaining)


@dataclass
class _RidingGeneration(CarParkGeneration):
    """It wants to be somewhere, and the only way there is a ride."""

    goal: Segment = _NOWHERE
    life: int = 0

    def reroute(
        self, origin: Segment, start_us: int, works: list[StationWork], now_us: int, *, asks: bool = False
    ) -> tuple[CarStep, ...] | None:
        """Onto the platform, up or down, and off it, as far as that is not done."""
        goal = self.goal
        if origin == goal:
            return ()
        onto, off = Segment(origin.track, 0), Segment(goal.track, 0)
        legs = [] if origin == onto else [(LegAction.TRAVEL, onto.track, origin.index, 0)]
        lift = lift_at(self.site, off)
        assert lift is not None
        ends = lift_index_of(self.site, lift, origin.track), lift_index_of(self.site, lift, goal.track)
        assert ends[0] is not None
        assert ends[1] is not None
        if ends[0] != ends[1]:
            legs.append((LegAction.RIDE, lift, ends[0], ends[1]))
        legs.append((LegAction.TRAVEL, goal.track, 0, goal.index))
        # Plans are told apart by when they begin, each by more than a while.
        by_us = (self.life * _PLANS + self.program.version) * WHILE_US
        return tuple(CarStep(*leg, _BEGIN_US + by_us, _END_US + by_us) for leg in legs)


@dataclass(frozen=True)
class RidingFactory(ParkingRobotFactory):
    """Robots that want to be at their goals, by node."""

    goals: Mapping[int, Segment] = field(default_factory=dict)

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> CarParkGeneration:
        """Its plan is always the same."""
        park: CarPark = car_park(site)
        goal = self.goals[machine.node_id]
        return _RidingGeneration(park, machine, way_mirror(mirror), _TimelessProgram(park), goal=goal)


def drives(body: AxisBody, behaviour: Behaviour) -> None:
    """The body's drive goes by this controller's orders."""
    if isinstance(behaviour, Lift):
        link = behaviour.link
        body.is_ordered = lambda: link.due_us is not None
        return
    assert isinstance(behaviour, ParkingRobot)
    carriage = behaviour.carriage
    body.is_ordered = lambda: carriage.refresh_at_us is not None
    body.floor = lambda: carriage.track

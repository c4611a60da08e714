"""A shipped robot whose way is no part of what is explored: it stands at once where its plan has it, and costs a price.

Its body is a carrier that is where it was last sent, and a shuttle that does at once what it is told.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import DriveMode, LegAction, Operation, ShuttleAction, ShuttleMode, Side
from onboard.contract.messages import CallForProposals, DriveState, Message, ShuttleOrder, ShuttleState
from onboard.core.behaviour import Behaviour
from onboard.core.effects import Actuate, Effect
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Proposal
from onboard.core.site import Machine, Segment, Site, Station
from onboard.systems.car_park.alternatives import Alternative, Solution
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import CarHandling, CarStep, Program, StationWork
from onboard.systems.car_park.robot import ParkingRobot, ParkingRobotFactory
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.travel import Carriage
from onboard.ways.mirror import way_mirror
from tests.models.at_work import Body
from tests.models.snapshot import NOW_US

#: Begin and end of each step, us: the same bus ms as an hour from now, and never late.
_BEGIN_US = NOW_US + (1 << 32) * 1000
_END_US = _BEGIN_US + 3_600_000_000
#: What a bid is above the deadline of its call, ms: nobody's floor is above that.
_PRICE_MS = 600_000
#: What a car weighs, kg.
CAR_KG = 1_500


class RobotState(NamedTuple):
    """Where a carrier stands, and how its shuttle does: the last order's sequence, mode and load in kg."""

    position_mm: int
    sequence: int = 0
    mode: ShuttleMode = ShuttleMode.HOME
    load_kg: int = 0


@dataclass
class RobotBody(Body):
    """Carrier and shuttle of one robot."""

    node: int
    now: RobotState
    #: Whether its strokes come to an end while it is looked at.
    is_quick: bool = True

    @property
    def state(self) -> RobotState:
        """Where all of it is."""
        return self.now

    def start(self) -> list[Message]:
        """Both tell where they are."""
        return [self.drive(), self._shuttle()]

    def drive(self) -> DriveState:
        """Where the carrier stands."""
        return DriveState(self.node, 0, self.now.position_mm, 0, DriveMode.STANDING, True)

    def _shuttle(self) -> ShuttleState:
        now = self.now
        return ShuttleState(self.node, now.sequence, now.mode, 0, Side.NEAR, now.load_kg, 2_500)

    def order(self, order: Message) -> list[Message]:
        """The carrier is there; the shuttle has done its stroke, gripped or let go."""
        if isinstance(order, DriveState):
            self.now = self.now._replace(position_mm=order.position_mm)
            return [order]
        assert isinstance(order, ShuttleOrder)
        if not self.is_quick:
            return []
        mode = ShuttleMode.HOME if order.action is ShuttleAction.RETRACT else ShuttleMode.REACHED
        load_kg = {ShuttleAction.GRIP: CAR_KG, ShuttleAction.RELEASE: 0}.get(order.action, self.now.load_kg)
        self.now = self.now._replace(sequence=order.sequence, mode=mode, load_kg=load_kg)
        return [self._shuttle()]


@dataclass
class _StandingCarriage(Carriage):
    """A carrier that is where it is sent, whoever has the slots."""

    def advance(self, now_us: int) -> list[Effect]:
        """Be there."""
        goal = self.goal
        if goal is None or goal == self.standing_at:
            self.target = None
            return []
        self.target, position_mm = goal, self.axis.position_mm(goal.index)
        return [Actuate(DriveState(self.fleet.node_id, 0, position_mm, 0, DriveMode.STANDING, True), None)]

    def claim(self, now_us: int) -> list[Effect]:
        """It was not pushed there."""
        return []


@dataclass
class _TimelessProgram(Program):
    """Nobody is early or late."""

    def shift(self, by_us: int) -> None:
        """Not at all."""


@dataclass
class PricedGeneration(CarParkGeneration):
    """What a task costs is its price, by node; its program is its two handlings."""

    prices_ms: Mapping[int, int] = field(default_factory=dict)

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Below the least price."""
        return call.deadline_ms + _PRICE_MS

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The price."""
        if self.program.standing is None or self.program.unplanned:
            return None
        return call.deadline_ms + _PRICE_MS + self.prices_ms.get(self.machine.node_id, 0)

    def solve(
        self, call: CallForProposals, now_us: int, *, behind_bids: bool = True
    ) -> tuple[Solution | None, list[Alternative]]:
        """Behind what is in hand."""
        is_fetched = call.operation is Operation.RETRIEVE
        place = Station.from_number(call.from_station) if is_fetched else self.site.places[0]
        ends = self.ends(call, place)
        handlings = (CarHandling.TAKE, CarHandling.LEAVE)
        works = [
            StationWork(handling, end, call.car, call.wheelbase_mm, call)
            for handling, end in zip(handlings, ends, strict=True)
        ]
        kept = len(self.program.remaining)
        steps = tuple(_step(work) for work in works)
        return Solution(kept, works[0].station.segment, _BEGIN_US, steps, _END_US, place), []

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """At its price."""
        (solution, _), cost = self.solve(call, now_us), self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, (solution,), ())

    def reroute(
        self, origin: Segment, start_us: int, works: list[StationWork], now_us: int, *, asks: bool = False
    ) -> tuple[CarStep, ...] | None:
        """The same handlings."""
        return tuple(_step(work) for work in works)


def _step(work: StationWork) -> CarStep:
    here = work.station.segment
    return CarStep(LegAction.WORK, here.track, here.index, here.index, _BEGIN_US, _END_US, work)


@dataclass(frozen=True)
class PricedFactory(ParkingRobotFactory):
    """Robots that differ by their prices, ms by node."""

    prices_ms: Mapping[int, int] = field(default_factory=dict)

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> CarParkGeneration:
        """What its bids come from."""
        park = car_park(site)
        return PricedGeneration(park, machine, way_mirror(mirror), _TimelessProgram(park), prices_ms=self.prices_ms)


def stand_still(behaviour: Behaviour) -> None:
    """Its carrier needs no way."""
    assert isinstance(behaviour, ParkingRobot)
    behaviour.carriage.__class__ = _StandingCarriage

"""A machine of the site that is none of ours: it speaks the bus well enough to bid, and does not do what it wins.

It stands where a robot of the site stands and takes its node-ID. ``Stranger`` says how it fails.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from bus_sim.systems.stranger import Stranger
from onboard.contract.codes import Grade, KindCode, LegAction, MachineState, Operation, Reason, Side, TaskPhase
from onboard.contract.messages import CallForProposals, Itinerary, Leg, Message, Progress, Stamp, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import Behaviour, BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, Proposal, cost_difference
from onboard.core.serial import BUS_MS_MODULUS, from_bus_ms, successor, to_bus_ms
from onboard.core.site import Machine, Site
from onboard.systems.car_park.alternatives import Alternative, Solution
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.least_bids import SLACK_MS
from onboard.systems.car_park.program import Program
from onboard.systems.car_park.robot import ParkingRobotFactory
from onboard.systems.car_park.site import car_park
from onboard.systems.registry import factory_for
from onboard.ways.mirror import way_mirror
from onboard.work.plain import Plain

#: What it says that its first run takes, ms.
RUN_MS = 10_000


class _LeastCarParkBid(CarParkGeneration):
    """Bids the least that counts, and can do the task only as soon as any robot."""

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The least that counts, where it can do the task at all."""
        return None if super().lower_bound(call, now_us) is None else self._that_counts(call, now_us)

    def proposal(self, call: CallForProposals, solution: Solution, alternatives: list[Alternative]) -> Proposal:
        """What it would do, for less than that takes."""
        honest = super().proposal(call, solution, alternatives)
        now_us = from_bus_ms(call.deadline_ms, solution.start_us) - self.site.timing.call_window_us
        return honest._replace(cost=self._that_counts(call, now_us))

    def _that_counts(self, call: CallForProposals, now_us: int) -> int:
        """As its way from the end of what it has told would take with nobody in its way, and the slack less."""
        floor, criterion = self.floor(call, now_us), call.criterion
        _, here, from_us = self.program.branch(now_us)
        least = self.least(call, now_us, here, from_us)
        if least is None or cost_difference(least, floor, criterion) <= SLACK_MS:
            return floor
        return (least - SLACK_MS) % BUS_MS_MODULUS


class _EmptyBid(_LeastCarParkBid):
    """Bids the least that counts, for nothing."""

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The least that counts."""
        return self._that_counts(call, now_us) if call.operation in (Operation.PARK, Operation.RETRIEVE) else None

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """No solution, and a bid all the same."""
        cost = self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, (), ())


@dataclass
class _StandingRobot(Plain):
    """It stands at its home, and says a plan for what it wins, unless it is ``silent``."""

    kind: KindCode = KindCode.ROBOT
    state: MachineState = MachineState.IDLE
    silent: bool = False
    itinerary: Itinerary | None = field(default=None)
    _version: int = 0

    def start(self, now_us: int) -> list[Effect]:
        """Here I am, and stay."""
        self._say((), Stamp(to_bus_ms(now_us), self.fleet.node_id, 0))
        return self.statements(now_us)

    def statements(self, now_us: int) -> list[Effect]:
        """Its place and its plan."""
        home = self.fleet.machine.home
        progress = Progress(self.fleet.node_id, self._version, 0, home.track, home.index, 0, 0)
        return [Send(progress), *([] if self.itinerary is None else [Send(self.itinerary)])]

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A task is won: a plan is told where it tells anything."""
        if self.silent or not isinstance(event, Awarded):
            return []
        home, call = self.fleet.machine.home, event.call
        away = home.index + (1 if home.index == 0 else -1)
        run = Leg(LegAction.TRAVEL, home.track, home.index, away, Side.NEAR, to_bus_ms(now_us) + RUN_MS)
        self._say((run,), Stamp(call.deadline_ms, call.sender, call.call & 0xFF))
        accepts = TaskReport(self.fleet.node_id, call.task, TaskPhase.AWARDED, call.from_station, Reason.NONE)
        return [*self.statements(now_us), Send(accepts)]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Nobody's business is its own."""
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """It stands there."""
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def _say(self, legs: tuple[Leg, ...], stamp: Stamp) -> None:
        self._version = successor(self._version, 8)
        self.itinerary = Itinerary(self.fleet.node_id, self._version, Grade.FIRM, stamp, legs)
        self.fleet.mirror.on_itinerary(self.itinerary, 0)


@dataclass
class _StrangeRobotFactory(BehaviourFactory):
    """Makes robots, one of which is the stranger."""

    target: int
    how: Stranger
    robots: ParkingRobotFactory = field(default_factory=ParkingRobotFactory)

    def __post_init__(self) -> None:
        self.fleet_type = self.robots.fleet_type

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Estimator:
        """What it bids."""
        if machine.node_id != self.target:
            return self.robots.estimator(site, machine, mirror)
        park, bids = car_park(site), _LeastCarParkBid if self.how is Stranger.LIAR else _EmptyBid
        # Who stands knows where from the first; the other finds its place as any robot does.
        program = Program(park, None if self.how is Stranger.LIAR else machine.home)
        return bids(park, machine, way_mirror(mirror), program)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Behaviour:
        """What it does."""
        if fleet.node_id != self.target or self.how is Stranger.LIAR:
            return self.robots.behaviour(fleet, estimator)
        return _StandingRobot(fleet, silent=self.how is Stranger.SILENT)


def factories_with(target: int, how: Stranger) -> Callable[[Site, KindCode], BehaviourFactory]:
    """For ``BusRun.factories``: node ``target`` is a stranger, all others are what they are."""
    stranger = _StrangeRobotFactory(target, how)

    def choose(site: Site, kind: KindCode) -> BehaviourFactory:
        return stranger if kind is KindCode.ROBOT else factory_for(site, kind)

    return choose

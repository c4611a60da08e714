"""Machines that somebody else directs: the same controllers with another way to settle who does what.

A compartment still calls, but waits for the dispatcher's word instead of bids; its award, the robot's program, rides,
plans and tokens are those of the normal path. A robot bids for nothing and does what it is awarded. Lifts and calls
for rides are as always. ``factories`` goes into a simulation before it starts, ``install`` right after.
"""

from dataclasses import dataclass, field
from typing import TypeVar

from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, KindCode, Operation
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, CallForProposals, Message
from onboard.core.behaviour import BehaviourFactory
from onboard.core.effects import Effect
from onboard.core.mirror import Mirror
from onboard.core.negotiation import (
    Awarded,
    CallKey,
    Initiator,
    Negotiation,
    NegotiationEvent,
    Proposal,
    RequestedTerms,
)
from onboard.core.negotiation.initiator import InitiatorEvent
from onboard.core.site import Machine, Segment, Site
from onboard.systems.car_park.generation import AWARD_LATENCY_US, CarParkGeneration
from onboard.systems.car_park.robot import ParkingRobotFactory
from onboard.systems.registry import factory_for

#: Node-ID under which the dispatcher speaks: one of those that no machine of a site has, and that may award.
DISPATCHER = 251
#: What a dispatcher decides about. Rides are between a robot and the lifts.
TASKS = (Operation.PARK, Operation.RETRIEVE)

Outcome = list[Effect | NegotiationEvent]
_N = TypeVar("_N", bound=Negotiation)


class WaitingInitiator(Initiator):
    """One task that waits for the dispatcher's word, without a deadline."""

    def open(self, now_us: int) -> Outcome:
        """Tell the task by a call for proposals."""
        outcome = super().open(now_us)
        self.due_us = None
        return outcome

    def on_bid(self, bid: Bid, now_us: int) -> Outcome:
        """Nobody is asked for bids."""
        return []

    def ordered(self, winner: int, now_us: int) -> Outcome:
        """The dispatcher has named a robot, or NOBODY where none can ever do it."""
        if winner == NOBODY:
            return self._fire(InitiatorEvent.EXHAUSTED, now_us)
        self.best = (0, winner)
        return self._fire(InitiatorEvent.DEADLINE_WITH_BID, now_us)


class CallingNegotiation(Negotiation):
    """A compartment that tells its tasks to a dispatcher and waits for the robot that it names."""

    def open(self, terms: RequestedTerms, now_us: int) -> list[Effect]:
        """Tell a task; the answer comes as a ``Closed`` event once the dispatcher has decided."""
        if terms.operation not in TASKS:
            return super().open(terms, now_us)
        initiator = WaitingInitiator(
            self.node_id, terms, self.timing, self.policy, self._next_call, counters=self.counters
        )
        self.initiators.append(initiator)
        return [item for item in initiator.open(now_us) if not isinstance(item, NegotiationEvent)]

    def receive(self, message: Message, now_us: int) -> Outcome:
        """The dispatcher's word, or any other message."""
        if not isinstance(message, Award) or message.sender != DISPATCHER:
            return super().receive(message, now_us)
        outcome: Outcome = []
        for initiator in self.initiators:
            if isinstance(initiator, WaitingInitiator) and initiator.terms.task == message.task:
                outcome += initiator.ordered(message.winner, now_us)
        self._forget(now_us)
        return outcome


@dataclass
class ObedientNegotiation(Negotiation):
    """A robot's side. ``orders`` holds the dispatcher's plan for each call that it is about to award to this robot."""

    orders: dict[CallKey, tuple[CallForProposals, Proposal]] = field(default_factory=dict)
    #: Calls whose awards it has obeyed: it took part in none, and yet knows of these.
    obeyed: set[CallKey] = field(default_factory=set)

    def knows(self, initiator: int, call: int) -> bool:
        """Whether it has its order for a call, or had; what the dispatcher says is for who called."""
        key = CallKey(initiator, call)
        is_ordered = initiator == DISPATCHER or key in self.orders or key in self.obeyed
        return is_ordered or super().knows(initiator, call)

    def receive(self, message: Message, now_us: int) -> Outcome:
        """A task is told and left alone; an award is obeyed, once."""
        if isinstance(message, CallForProposals) and message.operation in TASKS:
            return []
        outcome = super().receive(message, now_us)
        if isinstance(message, Award) and message.winner == self.node_id and message.result is CallResult.AWARDED:
            key = CallKey(message.sender, message.call)
            order = self.orders.pop(key, None)
            if order is not None:
                self.obeyed.add(key)
                outcome = [*outcome, Awarded(key, *order, message)]
        return outcome


class DispatchedGeneration(CarParkGeneration):
    """The robot's own planner, for tasks that are awarded at once: nobody has to wait for a call's deadline."""

    def _start(self, call: CallForProposals, now_us: int, *, behind_bids: bool = True) -> tuple[int, Segment, int]:
        kept, segment, start_us = self.program.branch(now_us)
        return kept, segment, max(start_us, now_us + AWARD_LATENCY_US)


class DispatchedRobotFactory(ParkingRobotFactory):
    """Makes robots for a dispatcher."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> CarParkGeneration:
        """The planner of the product, started from the moment of the award instead of the call's deadline."""
        usual = super().estimator(site, machine, mirror)
        return DispatchedGeneration(usual.site, usual.machine, usual.mirror, usual.program)


def factories(site: Site, kind: KindCode) -> BehaviourFactory:
    """The factory of one kind, robots that plan from the moment of the award."""
    return DispatchedRobotFactory() if kind is KindCode.ROBOT else factory_for(site, kind)


def install(simulation: Simulation) -> dict[int, ObedientNegotiation]:
    """Let robots and compartments wait for orders, before the first message; the robots' negotiations by node-ID."""
    obedient = {}
    for node, controller in simulation.controllers.items():
        holon = controller.holon
        if holon.machine.kind is KindCode.ROBOT:
            holon.negotiation = obedient[node] = _as(ObedientNegotiation, holon.negotiation)
        elif holon.machine.kind is KindCode.COMPARTMENT:
            holon.negotiation = _as(CallingNegotiation, holon.negotiation)
        holon.fleet.negotiation = holon.negotiation
    return obedient


def _as(cls: type[_N], one: Negotiation) -> _N:
    return cls(
        one.node_id,
        one.kind,
        one.timing,
        one.estimator,
        policy=one.policy,
        boot=one.boot,
        delay=one.delay,
        slot=one.slot,
    )

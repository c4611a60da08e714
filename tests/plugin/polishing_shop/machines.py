"""The desk, which calls for each part, and the polishers, which bid when it would be done."""

from dataclasses import dataclass, field

from onboard.contract.codes import Criterion, KindCode, MachineState, Operation, Reason, TaskPhase
from onboard.contract.messages import CallForProposals, Message, Reference, TaskReport
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send, Tell
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import ALONE, authorised
from onboard.core.negotiation import Awarded, Closed, Estimator, NegotiationEvent, Proposal, RequestedTerms
from onboard.core.site import Machine, Site
from onboard.work.plain import NoEstimator, Plain
from polishing_shop.frames import PartIn, PartOut, Polish, Polished
from polishing_shop.site import Shop


def shop(site: Site) -> Shop:
    """The site of a machine that is made for one."""
    assert isinstance(site, Shop)
    return site


@dataclass
class Bench:
    """What a polisher knows of its own future: when it is free. Asked for bids, told of parts won."""

    takes_us: int
    least_us: int
    free_at_us: int = 0

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Nobody is done sooner, ms."""
        return (now_us + self.least_us) // 1000

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """When it would be done, ms."""
        return (max(now_us, self.free_at_us) + self.takes_us) // 1000

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same as a bid."""
        cost = self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, (), ())


@dataclass
class Polisher(Plain):
    """Tells its motor the first of its parts until the motor says that it is done."""

    bench: Bench = field(default_factory=lambda: Bench(0, 0))
    parts: list[CallForProposals] = field(default_factory=list)
    ordered: CallForProposals | None = None

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A part is won: it stands in line."""
        if not isinstance(event, Awarded):
            return []
        self.parts.append(event.call)
        self.bench.free_at_us = max(now_us, self.bench.free_at_us) + self.bench.takes_us
        return [self._report(event.call, TaskPhase.AWARDED)]

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """The motor is done with a part."""
        if not isinstance(message, Polished) or not self.parts or message.number != self.parts[0].task.number:
            return []
        return [self._report(self.parts.pop(0), TaskPhase.DONE)]

    def advance(self, now_us: int) -> list[Effect]:
        """The motor hears of the first part once, as soon as this machine may move anything."""
        self.state = MachineState.WORKING if self.parts else MachineState.IDLE
        if not self.parts or self.ordered == self.parts[0]:
            return []
        order = authorised(self.fleet.motion, ALONE).order(Polish(self.fleet.node_id, self.parts[0].task.number))
        self.ordered = self.parts[0] if order else None
        return order

    def _report(self, call: CallForProposals, phase: TaskPhase) -> Effect:
        return Send(TaskReport(self.fleet.node_id, call.task, phase, call.from_station, Reason.NONE))


class PolisherFactory(BehaviourFactory):
    """Makes polishers."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Bench:
        """What it bids."""
        takes_us = shop(site).polishing_us
        return Bench(takes_us[machine.node_id], min(takes_us.values()))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Polisher:
        """What it does."""
        assert isinstance(estimator, Bench)
        return Polisher(fleet, KindCode.LATHE, bench=estimator)


@dataclass
class Desk(Plain):
    """Calls for each part that comes, again if nobody bids, and says at its rack when it is done."""

    called: set[int] = field(default_factory=set)

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """A part has come."""
        if not isinstance(message, PartIn) or message.number in self.called:
            return []
        self.called.add(message.number)
        # The part goes by its task's name.
        task = Reference(self.fleet.node_id, message.number)
        terms = RequestedTerms(task, Operation.MACHINE, KindCode.LATHE, Criterion.FINISH_TIME, 0, 0, task, 0)
        return self.fleet.negotiation.open(terms, now_us)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A part that nobody has taken is called for when the rack says it the next time."""
        if isinstance(event, Closed) and not event.winner:
            self.called.discard(event.call.task.number)
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """A part is done."""
        if not isinstance(message, TaskReport) or message.phase is not TaskPhase.DONE:
            return []
        if message.task.origin != self.fleet.node_id:
            return []
        return [Tell(PartOut(self.fleet.node_id, message.task.number))]


class DeskFactory(BehaviourFactory):
    """Makes desks."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """It bids for nothing."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Desk:
        """What it does."""
        return Desk(fleet, KindCode.DESK)

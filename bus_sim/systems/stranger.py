"""A machine of any system that bids what nobody can beat, and does not do what it wins.

It takes the node-ID of a machine of the site and, but for a liar, stands where that one stands.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.codes import KindCode, Reason, TaskPhase
from onboard.contract.messages import CallForProposals, Message, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import Behaviour, BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Estimator, NeededAnswers, NegotiationEvent, Proposal, SubCallAnswer
from onboard.core.site import Machine, Site
from onboard.systems.registry import factory_for
from onboard.work.plain import Plain


class Stranger(Enum):
    """In which way a machine bids and does not do what it wins."""

    STANDS = "stands"
    SILENT = "silent"
    LIAR = "liar"

    @property
    def does(self) -> str:
        """What such a machine does, behind ``a machine that``."""
        return {"stands": "stands", "silent": "is silent", "liar": "lies"}[self.value]


@dataclass
class _LeastBid:
    """Bids the least that counts: for what it can do, or (``is_empty``) for everything."""

    honest: Estimator
    is_empty: bool

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """As all compute it."""
        return self.honest.floor(call, now_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The least."""
        can = self.is_empty or self.honest.lower_bound(call, now_us) is not None
        return self.floor(call, now_us) if can else None

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        """What it would do, for less than that takes; or nothing at all."""
        honest, least = self.honest.estimate(call, now_us), self.floor(call, now_us)
        if not self.is_empty:
            return self._for_less(honest, least)
        # Where a bid has to go with what is said before it, the true one is the best that it can say.
        is_bound = isinstance(honest, Proposal) and honest.detail
        return honest if is_bound else Proposal(least, None, (), ())

    def _for_less(self, found: Proposal | NeededAnswers | None, least: int) -> Proposal | NeededAnswers | None:
        if not isinstance(found, NeededAnswers):
            # It tells nothing else than its number: with a bill that does not sum to it, it would convict itself.
            return None if found is None else found._replace(cost=least, detail=())

        def combine(answers: tuple[SubCallAnswer, ...], now_us: int) -> Proposal | NeededAnswers | None:
            return self._for_less(found.combine(answers, now_us), least)

        return NeededAnswers(least, found.parts, combine)


@dataclass
class _StandingMachine(Plain):
    """It says that it has what it wins, unless it is ``silent``, and does nothing. ``picture`` hears what all hear."""

    picture: Behaviour | None = None
    silent: bool = False
    _has: list[Effect] = field(default_factory=list)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A task is won: that is said where anything is."""
        if self.silent or not isinstance(event, Awarded):
            return []
        call = event.call
        accepts = Send(TaskReport(self.fleet.node_id, call.task, TaskPhase.AWARDED, call.from_station, Reason.NONE))
        self._has.append(accepts)
        return [accepts]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Only to know what calls are about."""
        if self.picture is not None:
            self.picture.hear(message, now_us)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """It stands there."""
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def statements(self, now_us: int) -> list[Effect]:
        """What it has, whoever asks, and its rights."""
        return [*self._has, *self.fleet.tokens.statements()]


@dataclass
class _StrangeFactory(BehaviourFactory):
    """Makes machines of one kind, one of which is the stranger."""

    target: int
    how: Stranger
    honest: BehaviourFactory

    def __post_init__(self) -> None:
        self.fleet_type = self.honest.fleet_type

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Estimator:
        """What it bids."""
        honest = self.honest.estimator(site, machine, mirror)
        is_strange = machine.node_id == self.target
        return _LeastBid(honest, is_empty=self.how is not Stranger.LIAR) if is_strange else honest

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Behaviour:
        """What it does."""
        if not isinstance(estimator, _LeastBid):
            return self.honest.behaviour(fleet, estimator)
        honest = self.honest.behaviour(fleet, estimator.honest)
        if self.how is Stranger.LIAR:
            return honest
        return _StandingMachine(fleet, kind=honest.kind, picture=honest, silent=self.how is Stranger.SILENT)


def factories_with(
    site: Site, worker: KindCode, target: int, how: Stranger
) -> Callable[[Site, KindCode], BehaviourFactory]:
    """For ``BusRun.factories``: node ``target``, a ``worker``, is a stranger, all others are what they are."""
    stranger = _StrangeFactory(target, how, factory_for(site, worker))

    def choose(of: Site, kind: KindCode) -> BehaviourFactory:
        return stranger if kind is worker else factory_for(of, kind)

    return choose

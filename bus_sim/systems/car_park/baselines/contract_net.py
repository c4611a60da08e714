"""The classic contract net on our bus: the FIPA Contract Net Interaction Protocol (SC00029H, 2002), for comparison.

Its acts go as our own messages, so every frame is in the DBC: *cfp* is a ``CallForProposals``; *propose* a ``Bid``,
*refuse* a ``Bid`` of cost ``REFUSAL``; *accept-proposal* an ``Award`` with result AWARDED, *reject-proposal* one with
REJECTED that names the rejected bidder. Every participant answers at once, and every proposer is answered. A lost
reject or accept is not repeated: the specification leaves loss to the transport below.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, KindCode, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, CallForProposals, Message
from onboard.core.effects import Effect, Send
from onboard.core.negotiation import (
    Awarded,
    CallKey,
    Closed,
    Estimator,
    NegotiationEvent,
    PreAssigned,
    Proposal,
    Released,
    RequestedTerms,
    beats,
    cut_off_us,
)
from onboard.core.serial import from_bus_ms, successor, to_bus_ms
from onboard.core.site import Timing

#: The cost that stands for *refuse*; a finishing time never reads so but for one millisecond in 49.7 days.
REFUSAL = 0xFFFFFFFF

Outcome = list[Effect | NegotiationEvent]


@dataclass
class ContractNetParticipant:
    """One machine that answers every call for its kind. All times are bus time in us."""

    node_id: int
    kind: KindCode
    estimator: Estimator
    proposals: dict[CallKey, tuple[CallForProposals, Proposal]] = field(default_factory=dict)

    def receive(self, message: Message, now_us: int) -> Outcome:
        """A call or its outcome; what is not for this machine changes nothing."""
        match message:
            case CallForProposals():
                return self._on_call(message, now_us)
            case Award():
                return self._on_award(message)
        return []

    def _on_call(self, call: CallForProposals, now_us: int) -> Outcome:
        key = CallKey(call.sender, call.call)
        if call.kind not in (KindCode.ANY, self.kind) or key in self.proposals:
            return []
        able = self.estimator.lower_bound(call, now_us) is not None
        proposal = self.estimator.estimate(call, now_us) if able else None
        if not isinstance(proposal, Proposal):
            # Contractors of the classic protocol know their cost by themselves.
            return [Send(Bid(self.node_id, call.sender, call.call, REFUSAL, 0))]
        self.proposals[key] = (call, proposal)
        return [
            Send(Bid(self.node_id, call.sender, call.call, proposal.cost, 0)),
            PreAssigned(key, call, proposal),
        ]

    def _on_award(self, award: Award) -> Outcome:
        key = CallKey(award.sender, award.call)
        if award.winner != self.node_id or key not in self.proposals:
            return []
        call, proposal = self.proposals.pop(key)
        if award.result is CallResult.AWARDED:
            return [Awarded(key, call, proposal, award)]
        return [Released(key, call, proposal, Reason.BEATEN)]


@dataclass
class ContractNetInitiator:
    """One machine that calls, one call at a time, and answers every proposer.

    ``participants`` are the node-IDs expected to answer: once all have, nobody waits for the deadline.
    """

    node_id: int
    timing: Timing
    participants: frozenset[int]
    call: CallForProposals | None = None
    terms: RequestedTerms | None = None
    deadline_us: int = 0
    bids: dict[int, int] = field(default_factory=dict)
    _last_call: int = 0

    def open(self, terms: RequestedTerms, now_us: int) -> list[Effect]:
        """Call for a task. Raises ``ValueError`` while another call is open."""
        if self.call is not None:
            raise ValueError(f"node {self.node_id} has call {self.call.call} open")
        self._last_call = successor(self._last_call, 16)
        self.terms = terms
        self.bids = {}
        self.call = CallForProposals(
            self.node_id,
            self._last_call,
            terms.task,
            terms.operation,
            terms.kind,
            terms.criterion,
            1,
            terms.depth,
            to_bus_ms(now_us + self.timing.call_window_us),
            terms.from_station,
            terms.to_station,
            terms.load,
            terms.load_mm,
        )
        self.deadline_us = from_bus_ms(self.call.deadline_ms, now_us)
        return [Send(self.call)]

    def receive(self, message: Message, now_us: int) -> Outcome:
        """A proposal or refusal for the open call; the last one expected closes it."""
        call = self.call
        if not isinstance(message, Bid) or call is None or message.initiator != self.node_id:
            return []
        if message.call != call.call or now_us > cut_off_us(self.deadline_us, self.timing):
            return []
        self.bids[message.sender] = message.cost
        return self._close() if self.participants <= self.bids.keys() else []

    def wake(self, now_us: int) -> Outcome:
        """Close the call where its deadline has passed."""
        return self._close() if self.call is not None and now_us >= self.deadline_us else []

    def next_wake(self) -> int | None:
        """The deadline of the open call."""
        return self.deadline_us if self.call is not None else None

    def _close(self) -> Outcome:
        assert self.call is not None
        call, self.call = self.call, None
        proposers = {node: cost for node, cost in self.bids.items() if cost != REFUSAL}
        if not proposers:
            return [Closed(call, NOBODY, CallResult.REFUSED, Reason.NO_BID, 1)]
        winner = _best(proposers.items(), call)
        outcome: Outcome = [Send(self._answer(call, winner, CallResult.AWARDED, Reason.NONE))]
        for node in sorted(proposers.keys() - {winner}):
            outcome.append(Send(self._answer(call, node, CallResult.REJECTED, Reason.BEATEN)))
        return [*outcome, Closed(call, winner, CallResult.AWARDED, Reason.NONE, 1)]

    def _answer(self, call: CallForProposals, node: int, result: CallResult, reason: Reason) -> Award:
        assert self.terms is not None
        return Award(self.node_id, call.call, node, call.task, self.terms.task_version, result, reason)


def _best(proposers: Iterable[tuple[int, int]], call: CallForProposals) -> int:
    """Lowest cost, then lowest node-ID: the order of our own protocol, so that winners can be compared."""
    best: tuple[int, int] | None = None
    for node, cost in proposers:
        if best is None or beats(cost, node, *best, call.criterion):
            best = (cost, node)
    assert best is not None
    return best[1]

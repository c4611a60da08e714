"""The participant's side of one call, as one transition table (rows P05 to P11, P14).

States and events are below; ``TABLE`` holds every pair that matters, all others change nothing. The participant is
lazy: it first waits for what its free-flow bound owes, then searches, then waits for what the real cost still owes. A
call that it cannot win costs no search and no frame.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from onboard.core.codes import CallResult, Reason
from onboard.core.effects import Effect, Send
from onboard.core.messages import Award, Bid, CallForProposals
from onboard.core.negotiation.bidding import beats, delay_us
from onboard.core.negotiation.events import (
    Awarded,
    CallKey,
    Estimator,
    NegotiationEvent,
    PreAssigned,
    Proposal,
    Released,
)
from onboard.core.serial import from_bus_ms
from onboard.core.site import Timing

Outcome = list[Effect | NegotiationEvent]


class State(Enum):
    """Where a participant stands in one call."""

    WAITING_BOUND = "waiting for what the free-flow bound owes"
    WAITING_COST = "searched, waiting for what the real cost owes"
    PRE_ASSIGNED = "own bid stands best"
    SILENT = "beaten or unable"
    BELIEVING = "deadline passed with own bid best, no award heard yet"
    ASSIGNED = "awarded"
    LOST = "closed for another"


class Event(Enum):
    """What can happen to a participant."""

    DUE = "own delay has run out"
    BEATEN = "a better bid is on the bus than I can make or made"
    DEADLINE = "the call's deadline has passed"
    AWARD_ME = "the initiator awards me"
    AWARD_OTHER = "the initiator closes the call for another, or for nobody"


@dataclass
class Counters:
    """What one machine's bidding has cost so far."""

    calls_heard: int = 0
    calls_of_other_kind: int = 0
    calls_impossible: int = 0
    searches: int = 0
    searches_saved: int = 0
    bids_sent: int = 0
    bids_saved: int = 0
    outbid: int = 0
    won: int = 0
    late_bids_ignored: int = 0
    beliefs_without_award: int = 0


@dataclass
class Participant:
    """One machine in one call of another. All times are bus time in us."""

    node_id: int
    call: CallForProposals
    timing: Timing
    estimator: Estimator
    counters: Counters
    silent: bool
    deadline_us: int
    state: State = State.WAITING_BOUND
    due_us: int | None = None
    heard_us: int = 0
    floor: int = 0
    bound: int = 0
    proposal: Proposal | None = None
    best: tuple[int, int] | None = None
    award: Award | None = None
    _table: dict[tuple[State, Event], tuple[State, Callable[[int], Outcome]]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        waits, searched = State.WAITING_BOUND, State.WAITING_COST
        mine, silent, believes = State.PRE_ASSIGNED, State.SILENT, State.BELIEVING
        self._table = {
            (waits, Event.DUE): (searched, self._search),
            (waits, Event.BEATEN): (silent, self._save_search),
            (waits, Event.DEADLINE): (silent, self._save_search),
            (waits, Event.AWARD_OTHER): (State.LOST, self._save_search),
            (searched, Event.DUE): (mine, self._bid),
            (searched, Event.BEATEN): (silent, self._save_bid),
            (searched, Event.DEADLINE): (silent, self._save_bid),
            (searched, Event.AWARD_OTHER): (State.LOST, self._save_bid),
            (mine, Event.BEATEN): (silent, self._outbid),
            (mine, Event.DEADLINE): (believes, self._believe),
            (mine, Event.AWARD_ME): (State.ASSIGNED, self._assign),
            (mine, Event.AWARD_OTHER): (State.LOST, self._outbid),
            (silent, Event.AWARD_ME): (State.ASSIGNED, self._assign),
            (silent, Event.AWARD_OTHER): (State.LOST, self._nothing),
            (believes, Event.AWARD_ME): (State.ASSIGNED, self._assign),
            (believes, Event.AWARD_OTHER): (State.LOST, self._outbid),
        }

    @property
    def key(self) -> CallKey:
        """Which call."""
        return CallKey(self.call.sender, self.call.call)

    @property
    def is_over(self) -> bool:
        """Whether nothing can happen any more."""
        return self.state in (State.ASSIGNED, State.LOST)

    def open(self, now_us: int) -> Outcome:
        """Hear the call: compute floor and bound and start waiting, or stay silent for good."""
        self.counters.calls_heard += 1
        self.heard_us = now_us
        bound = self.estimator.lower_bound(self.call, now_us)
        if bound is None:
            self.counters.calls_impossible += 1
            self.state = State.SILENT
            return []
        self.bound = bound
        self.floor = self.estimator.floor(self.call, now_us)
        self.due_us = now_us + self._delay_us(bound)
        return []

    def on_bid(self, bid: Bid, now_us: int) -> Outcome:
        """A bid of another machine; one received after the deadline is ignored and counted."""
        if now_us > self.deadline_us:
            self.counters.late_bids_ignored += 1
            return []
        if self.best is None or beats(bid.cost, bid.sender, *self.best, self.call.criterion):
            self.best = (bid.cost, bid.sender)
        return self._fire(Event.BEATEN, now_us) if self._is_beaten() else []

    def on_award(self, award: Award, now_us: int) -> Outcome:
        """The initiator closes the call. Idempotent."""
        self.award = award
        mine = award.result is CallResult.AWARDED and award.winner == self.node_id and self.proposal is not None
        return self._fire(Event.AWARD_ME if mine else Event.AWARD_OTHER, now_us)

    def wake(self, now_us: int) -> Outcome:
        """Let the delay and the deadline pass where they are due."""
        outcome: Outcome = []
        # A search may owe no further delay, so being due can follow being due; the table ends that after two.
        while self.due_us is not None and self.due_us <= now_us:
            self.due_us = None
            last_us = self.deadline_us - self.timing.deadline_guard_us
            outcome += self._fire(Event.DUE if now_us < last_us else Event.DEADLINE, now_us)
        if now_us >= self.deadline_us:
            outcome += self._fire(Event.DEADLINE, now_us)
        return outcome

    def next_wake(self) -> int | None:
        """The delay's end, or the deadline where that changes something."""
        if self.due_us is not None:
            return min(self.due_us, self.deadline_us)
        return self.deadline_us if self.state is State.PRE_ASSIGNED else None

    def _fire(self, event: Event, now_us: int) -> Outcome:
        entry = self._table.get((self.state, event))
        if entry is None:
            return []
        self.state, action = entry
        return action(now_us)

    # --- actions -----------------------------------------------------------------------------------------------

    def _search(self, now_us: int) -> Outcome:
        self.counters.searches += 1
        proposal = self.estimator.estimate(self.call, now_us)
        if proposal is None:
            self.counters.calls_impossible += 1
            self.state = State.SILENT
            return []
        self.proposal = proposal
        if self._is_beaten():
            return self._fire(Event.BEATEN, now_us)
        self.due_us = max(now_us, self.heard_us + self._delay_us(proposal.cost))
        return []

    def _bid(self, now_us: int) -> Outcome:
        assert self.proposal is not None
        self.counters.bids_sent += 1
        itinerary = self.proposal.itinerary
        version = itinerary.version if itinerary is not None else 0
        self.best = (self.proposal.cost, self.node_id)
        bid = Bid(self.node_id, self.call.sender, self.call.call, self.proposal.cost, version)
        outcome: Outcome = [Send(bid)]
        if itinerary is not None:
            outcome.append(Send(itinerary))
        outcome.append(PreAssigned(self.key, self.call, self.proposal))
        return outcome

    def _outbid(self, now_us: int) -> Outcome:
        assert self.proposal is not None
        self.counters.outbid += 1
        return [Released(self.key, self.call, self.proposal, Reason.BEATEN)]

    def _believe(self, now_us: int) -> Outcome:
        """The deadline passed with my bid best. I may prepare; I act only on the award (but in the silent form)."""
        assert self.proposal is not None
        if not self.silent:
            self.counters.beliefs_without_award += 1
            return []
        self.state = State.ASSIGNED
        self.counters.won += 1
        return [Awarded(self.key, self.call, self.proposal, None)]

    def _assign(self, now_us: int) -> Outcome:
        assert self.proposal is not None
        self.counters.won += 1
        return [Awarded(self.key, self.call, self.proposal, self.award)]

    def _save_search(self, now_us: int) -> Outcome:
        self.due_us = None
        self.counters.searches_saved += 1
        return []

    def _save_bid(self, now_us: int) -> Outcome:
        self.due_us = None
        self.counters.bids_saved += 1
        return []

    def _nothing(self, now_us: int) -> Outcome:
        return []

    # --- judgement ---------------------------------------------------------------------------------------------

    def _is_beaten(self) -> bool:
        """Whether the best bid heard is at least as good as what I made or could make (row P07)."""
        if self.best is None or self.best[1] == self.node_id:
            return False
        cost = self.bound if self.proposal is None else self.proposal.cost
        return not beats(cost, self.node_id, *self.best, self.call.criterion)

    def _delay_us(self, cost: int) -> int:
        return delay_us(cost, self.floor, self.call.criterion, self.timing)


def deadline_of(call: CallForProposals, now_us: int) -> int:
    """A call's deadline as bus time in us."""
    return from_bus_ms(call.deadline_ms, now_us)

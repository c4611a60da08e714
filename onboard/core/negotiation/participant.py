"""The participant's side of one call, as one transition table (rows P05 to P11, P14).

States and events are below; ``TABLE``, at the end, holds every pair that matters, all others change nothing. The
participant is lazy: it first waits for what its free-flow bound owes, then searches, then waits for what the real cost
still owes. A call that it cannot win costs no search and no frame.

Where the cost depends on others, sub-calls open when the delay for the least cost has run out unbeaten; their answers
make the bid, and the award confirms the options that it rests on. A bid for such a sub-call is itself an option: held
until it is confirmed, given up or over, and never acted upon before.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.codes import CallResult, Reason
from onboard.contract.messages import Award, Bid, CallForProposals, Reference
from onboard.core.effects import Effect, Send
from onboard.core.negotiation.bidding import (
    ANY_TIME,
    DelayRule,
    SpeakingSlot,
    beats,
    cut_off_us,
    delay_us,
    in_slot,
    is_below,
    last_bid_us,
)
from onboard.core.negotiation.counters import Counters
from onboard.core.negotiation.events import (
    Awarded,
    AwardedAgain,
    CallKey,
    Estimator,
    NeededAnswers,
    NegotiationEvent,
    PreAssigned,
    Proposal,
    Released,
)
from onboard.core.negotiation.initiator import is_any_sound, nobody_is
from onboard.core.negotiation.sub_calls import SubCalls
from onboard.core.site import Timing

Outcome = list[Effect | NegotiationEvent]

#: A belief without an award lapses this many award repeats after the deadline (10 s at the default of 100 ms): by then
#: an initiator that meant this machine has said so about twenty times.
LAPSE_REPEATS = 100


class ParticipantState(Enum):
    """Where a participant stands in one call."""

    WAITING_BOUND = "waiting for what the free-flow bound owes"
    WAITING_COST = "searched, waiting for what the real cost owes"
    ASKING = "waiting for the answers to own sub-calls"
    PRE_ASSIGNED = "own bid stands best"
    SILENT = "beaten or unable"
    BELIEVING = "deadline passed with own bid best, no award heard yet"
    OPTION = "own bid is held as an option of the initiator"
    LAPSED = "no award came for long; one that comes yet still counts"
    ASSIGNED = "awarded"
    LOST = "closed for another, or for nobody"


class ParticipantEvent(Enum):
    """What can happen to a participant."""

    DUE = "own delay has run out"
    NEED = "own delay has run out, and others must be asked first"
    ANSWERED = "all own sub-calls have come to their deadlines"
    IMPOSSIBLE = "the search found no solution"
    BEATEN = "a better bid is on the bus than I can make or made"
    DEADLINE = "it is too late to bid, or the call's deadline has passed"
    CHANGED = "a bid or task of my own in another call, or what others plan, makes what I searched stale"
    LAPSE = "the award is overdue, or the option is over"
    OPTION_ME = "the initiator holds my bid as an option"
    AWARD_ME = "the initiator awards me"
    AWARD_OTHER = "the initiator closes the call for another, or for nobody"
    SUPERSEDED = "the initiator has called anew for the same task"


@dataclass
class Participant:
    """One machine in one call of another. All times are bus time in us. ``subs`` are the sub-calls that it may open."""

    node_id: int
    call: CallForProposals
    timing: Timing
    estimator: Estimator
    counters: Counters
    deadline_us: int
    subs: SubCalls
    delay: DelayRule = delay_us
    slot: SpeakingSlot = ANY_TIME
    #: Whose bids do not count: obstacles, by my mirror, and those that the initiator named.
    is_obstacle: Callable[[int], bool] = nobody_is
    left_out: frozenset[int] = frozenset()
    is_sound: Callable[[Reference, Bid], bool] = is_any_sound
    state: ParticipantState = ParticipantState.WAITING_BOUND
    due_us: int | None = None
    heard_us: int = 0
    floor: int = 0
    bound: int = 0
    proposal: Proposal | None = None
    needs: NeededAnswers | None = None
    best: tuple[int, int] | None = None
    award: Award | None = None
    rivals_until_us: int = 0
    is_stale: bool = False
    searched: Proposal | NeededAnswers | None = None
    has_bid: bool = False
    last_bid_us: int = field(init=False)
    cut_off_us: int = field(init=False)
    lapse_us: int = field(init=False)

    def __post_init__(self) -> None:
        self.last_bid_us = last_bid_us(self.deadline_us, self.timing)
        self.cut_off_us = cut_off_us(self.deadline_us, self.timing)
        patience_us = self.call.hold_ms * 1000 or LAPSE_REPEATS * self.timing.award_repeat_us
        self.lapse_us = self.deadline_us + patience_us

    @property
    def key(self) -> CallKey:
        """The initiator's node-ID and its number of the call: what all frames of one call share."""
        return CallKey(self.call.sender, self.call.call)

    @property
    def is_over(self) -> bool:
        """Whether nothing can happen any more."""
        return self.state in (ParticipantState.ASSIGNED, ParticipantState.LOST)

    @property
    def is_committed(self) -> bool:
        """Whether the machine keeps reservations for this call."""
        return self.state in (ParticipantState.PRE_ASSIGNED, ParticipantState.BELIEVING, ParticipantState.OPTION)

    # --- events ------------------------------------------------------------------------------------------------

    def open(self, now_us: int) -> Outcome:
        """Hear the call: compute floor and bound and start waiting, or stay silent for good."""
        self.counters.calls_heard += 1
        self.heard_us = now_us
        bound = None if self.node_id in self.left_out else self.estimator.lower_bound(self.call, now_us)
        if bound is None:
            return self._fire(ParticipantEvent.IMPOSSIBLE, now_us)
        self.bound = bound
        self.floor = self.estimator.floor(self.call, now_us)
        self.due_us = now_us + self._delay_us(bound)
        return []

    def on_bid(self, bid: Bid, now_us: int) -> Outcome:
        """A bid of another machine; one received after the cut-off is ignored and counted, as the initiator does."""
        if now_us > self.cut_off_us:
            self.counters.late_bids_ignored += 1
            return []
        no_account = self.is_obstacle(bid.sender) or bid.sender in self.left_out or self._is_below_floor(bid.cost)
        if no_account or not self.is_sound(self.call.task, bid):
            self.counters.bids_of_no_account += 1
            return []
        if self.best is None or beats(bid.cost, bid.sender, *self.best, self.call.criterion):
            self.best = (bid.cost, bid.sender)
        return self._fire(ParticipantEvent.BEATEN, now_us) if self._is_beaten() else []

    def on_rival(self, deadline_us: int) -> None:
        """Another bidder asks others first, until ``deadline_us``: it was sooner, so its cost is likely to be less.

        Where there is still time afterwards, own sub-calls wait for its bid: most bidders then ask nobody.
        """
        self.rivals_until_us = max(self.rivals_until_us, deadline_us)
        if self.state is ParticipantState.WAITING_COST and self.needs is not None and self.due_us is not None:
            self.due_us = self._behind_rivals_us(self.due_us)

    def on_change(self, now_us: int) -> Outcome:
        """This machine has bid, or won, in another call: what it does there, it does first."""
        return self._fire(ParticipantEvent.CHANGED, now_us)

    def on_award(self, award: Award, now_us: int) -> Outcome:
        """The initiator closes the call, or holds the best bid as an option. Idempotent."""
        self.award = award
        named = award.winner == self.node_id and self.has_bid
        if named and award.result is CallResult.OPTION:
            return self._fire(ParticipantEvent.OPTION_ME, now_us)
        mine = named and award.result is CallResult.AWARDED
        return self._fire(ParticipantEvent.AWARD_ME if mine else ParticipantEvent.AWARD_OTHER, now_us)

    def supersede(self, now_us: int) -> Outcome:
        """The call is void: a newer one is for the same task, or there is no room to remember this one."""
        return self._fire(ParticipantEvent.SUPERSEDED, now_us)

    def wake(self, now_us: int) -> Outcome:
        """Let the delay, the deadline and the patience after it pass where they are due."""
        outcome: Outcome = []
        # A search may owe no further delay, so being due can follow being due; the table ends that after two.
        while self.due_us is not None and min(self.due_us, self.last_bid_us) <= now_us:
            self.due_us = None
            is_found = self.state is ParticipantState.WAITING_COST
            due = ParticipantEvent.NEED if is_found and self.needs is not None else ParticipantEvent.DUE
            if is_found and self.proposal is not None and self.proposal.stands and not self.proposal.stands(now_us):
                due = ParticipantEvent.CHANGED
            outcome += self._fire(due if now_us < self.last_bid_us else ParticipantEvent.DEADLINE, now_us)
        if now_us >= self.deadline_us:
            outcome += self._fire(ParticipantEvent.DEADLINE, now_us)
        if now_us >= self.lapse_us:
            outcome += self._fire(ParticipantEvent.LAPSE, now_us)
        return outcome

    def collect(self, now_us: int) -> Outcome:
        """Go on where the last sub-call asked for has come to its deadline."""
        if self.state is not ParticipantState.ASKING or not self.subs.is_answered:
            return []
        return self._fire(ParticipantEvent.ANSWERED, now_us)

    def next_wake(self) -> int | None:
        """The delay's end, or the moment at which waiting for something else ends."""
        if self.due_us is not None:
            return min(self.due_us, self.last_bid_us)
        if self.state is ParticipantState.PRE_ASSIGNED:
            return self.deadline_us
        return self.lapse_us if self.state in (ParticipantState.BELIEVING, ParticipantState.OPTION) else None

    def _fire(self, event: ParticipantEvent, now_us: int) -> Outcome:
        entry = TABLE.get((self.state, event))
        if entry is None:
            return []
        self.state, action = entry
        outcome = action(self, now_us)
        # Whatever ends the hope of winning ends the options that the bid would have rested on.
        return outcome + self.subs.drop(now_us) if self.state in _HOPELESS else outcome

    # --- actions -----------------------------------------------------------------------------------------------

    def search(self, now_us: int) -> Outcome:
        """Ask for the real cost, then wait for what it owes beyond the bound."""
        if self._is_new(now_us):
            return self.subs.begin_anew(now_us) + self._weigh(self.searched, now_us)
        return self._weigh(self.proposal or self.needs, now_us)

    def _is_new(self, now_us: int) -> bool:
        """Search, and tell whether that has found anything else than the search before."""
        self.counters.searches += 1
        self.is_stale = False
        before, self.searched = self.searched, self.estimator.estimate(self.call, now_us)
        return before is None or self.searched is None or _essence(before) != _essence(self.searched)

    def _weigh(self, found: Proposal | NeededAnswers | None, now_us: int) -> Outcome:
        if found is None:
            return self._fire(ParticipantEvent.IMPOSSIBLE, now_us)
        self.proposal, self.needs = (None, found) if isinstance(found, NeededAnswers) else (found, None)
        self.bound = found.cost
        if self._is_beaten():
            return self._fire(ParticipantEvent.BEATEN, now_us)
        due_us = self._turn_us(self._delay_us(found.cost), now_us)
        self.due_us = due_us if self.needs is None else self._behind_rivals_us(due_us)
        return []

    def ask(self, now_us: int) -> Outcome:
        """Nobody was better so far: open the sub-calls. Where there is no time or depth left for them: silence."""
        assert self.needs is not None
        outcome = self.subs.ask(self.needs.parts, now_us)
        if outcome is None:
            return self._fire(ParticipantEvent.IMPOSSIBLE, now_us)
        self.counters.sub_calls_opened += len(self.needs.parts)
        self.due_us = self.last_bid_us
        return outcome

    def combine(self, now_us: int) -> Outcome:
        """All have answered: the proposal, or a second round."""
        assert self.needs is not None
        self.due_us = None
        if self.is_stale and self._is_new(now_us):
            return self.subs.begin_anew(now_us) + self._weigh(self.searched, now_us)
        return self._weigh(self.needs.combine(self.subs.answers(), now_us), now_us)

    def search_again(self, now_us: int) -> Outcome:
        """Search anew as soon as the machine has taken the change up: with its next turn."""
        self.due_us = now_us + 1
        return []

    def note_change(self, now_us: int) -> Outcome:
        """Search anew when the answers have come."""
        self.is_stale = True
        return []

    def bid(self, now_us: int) -> Outcome:
        """Release the bid, and with it the reservations that it rests on (rows P10, P48)."""
        assert self.proposal is not None
        self.counters.bids_sent += 1
        self.has_bid = True
        itinerary = self.proposal.itinerary
        version = itinerary.version if itinerary is not None else self.proposal.version
        self.best = (self.proposal.cost, self.node_id)
        bid = Bid(self.node_id, self.call.sender, self.call.call, self.proposal.cost, version)
        outcome: Outcome = [*(Send(message) for message in self.proposal.detail), Send(bid)]
        if itinerary is not None:
            outcome.append(Send(itinerary))
        outcome.append(PreAssigned(self.key, self.call, self.proposal))
        return outcome + self.subs.drop(now_us, keep=self.proposal.parts)

    def believe(self, now_us: int) -> Outcome:
        """The deadline passed with my bid best. I may prepare; I act only on the award (but in the silent form)."""
        if self.timing.silent and not self.call.hold_ms:
            return self._fire(ParticipantEvent.AWARD_ME, now_us)
        self.counters.beliefs_without_award += 1
        return []

    def assign(self, now_us: int) -> Outcome:
        """The task is mine, and with it the options that the bid rests on."""
        assert self.proposal is not None
        self.counters.won += 1
        confirmed, outcome = self.subs.confirm(self.proposal.parts, now_us)
        return [Awarded(self.key, self.call, self.proposal, self.award, confirmed), *outcome]

    def answer(self, now_us: int) -> Outcome:
        """The award is said again: my words were not heard. The machine tells what became of the task."""
        return [AwardedAgain(self.key, self.call)]

    def hold_again(self, now_us: int) -> Outcome:
        """I took myself for beaten, and the initiator holds my bid: reserve anew."""
        assert self.proposal is not None
        return [PreAssigned(self.key, self.call, self.proposal)]

    def release_beaten(self, now_us: int) -> Outcome:
        """A better bid frees what mine reserved."""
        self.counters.outbid += 1
        return self._release(Reason.BEATEN)

    def release_closed(self, now_us: int) -> Outcome:
        """So does the initiator's last word; its reason says why where the call had no winner."""
        assert self.award is not None
        return self._release(self.award.reason if self.award.reason is not Reason.NONE else Reason.BEATEN)

    def release_void(self, now_us: int) -> Outcome:
        """So does a newer call for the same task."""
        return self._release(Reason.CANCELLED)

    def release_lapsed(self, now_us: int) -> Outcome:
        """So does an award, or the decision on an option, that does not come; nobody waits for ever (row P14)."""
        self.counters.beliefs_lapsed += 1
        return self._release(Reason.LATE)

    def save_search(self, now_us: int) -> Outcome:
        """Decided before a search was worth it."""
        self.due_us = None
        self.counters.searches_saved += 1
        return []

    def save_bid(self, now_us: int) -> Outcome:
        """Decided before the bid was due."""
        self.due_us = None
        self.counters.bids_saved += 1
        return []

    def give_up(self, now_us: int) -> Outcome:
        """The task cannot be done: silence (rows P09, P45)."""
        self.counters.calls_impossible += 1
        return []

    def rest(self, now_us: int) -> Outcome:
        """What the table names where an event changes the state and needs no action."""
        return []

    # --- judgement ---------------------------------------------------------------------------------------------

    def _release(self, reason: Reason) -> Outcome:
        assert self.proposal is not None
        return [Released(self.key, self.call, self.proposal, reason)]

    def _is_beaten(self) -> bool:
        """Whether the best bid heard is at least as good as what I made or could make (row P07)."""
        if self.best is None or self.best[1] == self.node_id:
            return False
        return not beats(self.bound, self.node_id, *self.best, self.call.criterion)

    def _is_below_floor(self, cost: int) -> bool:
        """Whether a bid is better than anybody could be; only who could bid itself has worked that out."""
        return bool(self.floor) and is_below(cost, self.floor, self.call.criterion)

    def _delay_us(self, cost: int) -> int:
        return in_slot(self.delay(cost, self.floor, self.call.criterion, self.timing), self.slot)

    def _turn_us(self, delay_us: int, now_us: int) -> int:
        """When a delay since hearing the call has run out; once answers have come, not before the own slot's turn.

        Others may have asked at the same time: their answers, and so their bids, would come at one moment.
        """
        due_us = self.heard_us + delay_us
        if due_us >= now_us or not self.subs.asked:
            return max(now_us, due_us)
        round_us = self.slot.slots * self.slot.length_us
        late_us = now_us - due_us
        return due_us + -(-late_us // round_us) * round_us if round_us else now_us

    def _behind_rivals_us(self, due_us: int) -> int:
        """When to ask others: once the bid of whoever asked before could be heard, unless that is too late."""
        heard_us = self.rivals_until_us + self.slot.slots * self.slot.length_us + self.timing.deadline_guard_us
        return heard_us if heard_us > due_us and self.subs.may_ask(heard_us) else due_us


def _essence(one: Proposal | NeededAnswers) -> tuple[object, ...]:
    """What two searches must have in common for the answers to the first to do for the second."""
    return (one.cost, one.parts or one.combine) if isinstance(one, NeededAnswers) else (one.cost, one.program)


#: States in which nothing more is hoped for from a call.
_HOPELESS = (ParticipantState.SILENT, ParticipantState.LAPSED, ParticipantState.LOST)


#: The whole protocol of a participant: (state, event) to the next state and what is done on the way.
TABLE: dict[
    tuple[ParticipantState, ParticipantEvent], tuple[ParticipantState, Callable[[Participant, int], Outcome]]
] = {
    (ParticipantState.WAITING_BOUND, ParticipantEvent.DUE): (ParticipantState.WAITING_COST, Participant.search),
    (ParticipantState.WAITING_BOUND, ParticipantEvent.IMPOSSIBLE): (ParticipantState.SILENT, Participant.give_up),
    (ParticipantState.WAITING_BOUND, ParticipantEvent.BEATEN): (ParticipantState.SILENT, Participant.save_search),
    (ParticipantState.WAITING_BOUND, ParticipantEvent.DEADLINE): (ParticipantState.SILENT, Participant.save_search),
    (ParticipantState.WAITING_BOUND, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.save_search),
    (ParticipantState.WAITING_BOUND, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.save_search),
    (ParticipantState.WAITING_COST, ParticipantEvent.DUE): (ParticipantState.PRE_ASSIGNED, Participant.bid),
    (ParticipantState.WAITING_COST, ParticipantEvent.IMPOSSIBLE): (ParticipantState.SILENT, Participant.give_up),
    (ParticipantState.WAITING_COST, ParticipantEvent.BEATEN): (ParticipantState.SILENT, Participant.save_bid),
    (ParticipantState.WAITING_COST, ParticipantEvent.DEADLINE): (ParticipantState.SILENT, Participant.save_bid),
    (ParticipantState.WAITING_COST, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.save_bid),
    (ParticipantState.WAITING_COST, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.save_bid),
    (ParticipantState.WAITING_COST, ParticipantEvent.NEED): (ParticipantState.ASKING, Participant.ask),
    (ParticipantState.WAITING_COST, ParticipantEvent.CHANGED): (
        ParticipantState.WAITING_BOUND,
        Participant.search_again,
    ),
    (ParticipantState.ASKING, ParticipantEvent.CHANGED): (ParticipantState.ASKING, Participant.note_change),
    (ParticipantState.ASKING, ParticipantEvent.ANSWERED): (ParticipantState.WAITING_COST, Participant.combine),
    (ParticipantState.ASKING, ParticipantEvent.IMPOSSIBLE): (ParticipantState.SILENT, Participant.give_up),
    (ParticipantState.ASKING, ParticipantEvent.BEATEN): (ParticipantState.SILENT, Participant.save_bid),
    (ParticipantState.ASKING, ParticipantEvent.DEADLINE): (ParticipantState.SILENT, Participant.save_bid),
    (ParticipantState.ASKING, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.save_bid),
    (ParticipantState.ASKING, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.save_bid),
    (ParticipantState.PRE_ASSIGNED, ParticipantEvent.BEATEN): (ParticipantState.SILENT, Participant.release_beaten),
    (ParticipantState.PRE_ASSIGNED, ParticipantEvent.DEADLINE): (ParticipantState.BELIEVING, Participant.believe),
    (ParticipantState.PRE_ASSIGNED, ParticipantEvent.OPTION_ME): (ParticipantState.OPTION, Participant.rest),
    (ParticipantState.PRE_ASSIGNED, ParticipantEvent.AWARD_ME): (ParticipantState.ASSIGNED, Participant.assign),
    (ParticipantState.PRE_ASSIGNED, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.release_closed),
    (ParticipantState.PRE_ASSIGNED, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.release_void),
    (ParticipantState.SILENT, ParticipantEvent.OPTION_ME): (ParticipantState.OPTION, Participant.hold_again),
    (ParticipantState.SILENT, ParticipantEvent.AWARD_ME): (ParticipantState.ASSIGNED, Participant.assign),
    (ParticipantState.SILENT, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.rest),
    (ParticipantState.SILENT, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.rest),
    (ParticipantState.BELIEVING, ParticipantEvent.LAPSE): (ParticipantState.LAPSED, Participant.release_lapsed),
    (ParticipantState.BELIEVING, ParticipantEvent.OPTION_ME): (ParticipantState.OPTION, Participant.rest),
    (ParticipantState.BELIEVING, ParticipantEvent.AWARD_ME): (ParticipantState.ASSIGNED, Participant.assign),
    (ParticipantState.BELIEVING, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.release_closed),
    (ParticipantState.BELIEVING, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.release_void),
    (ParticipantState.OPTION, ParticipantEvent.LAPSE): (ParticipantState.LAPSED, Participant.release_lapsed),
    (ParticipantState.OPTION, ParticipantEvent.AWARD_ME): (ParticipantState.ASSIGNED, Participant.assign),
    (ParticipantState.OPTION, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.release_closed),
    (ParticipantState.OPTION, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.release_void),
    (ParticipantState.ASSIGNED, ParticipantEvent.AWARD_ME): (ParticipantState.ASSIGNED, Participant.answer),
    (ParticipantState.LAPSED, ParticipantEvent.AWARD_ME): (ParticipantState.ASSIGNED, Participant.assign),
    (ParticipantState.LAPSED, ParticipantEvent.AWARD_OTHER): (ParticipantState.LOST, Participant.rest),
    (ParticipantState.LAPSED, ParticipantEvent.SUPERSEDED): (ParticipantState.LOST, Participant.rest),
}

"""The initiator's side of one call, as one transition table (rows P05, P11, P12, P14).

Nobody answers: the call is opened again, changed as the restart policy says, a bounded number of times, then reported
as refused. Somebody wins: one award closes the call and is said again until the winner is heard acting on it.

A sub-call before a bid has one attempt, and its best bid is held as an option until it is confirmed or given up.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum

from onboard.contract.codes import CallResult, Criterion, Grade, Operation, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, Reference, TaskReport
from onboard.core.effects import Effect, Report, Send
from onboard.core.negotiation.bidding import beats, cut_off_us, is_below
from onboard.core.negotiation.counters import Counters
from onboard.core.negotiation.events import Closed, NegotiationEvent, RequestedTerms
from onboard.core.negotiation.trust import Trust, left_out_words
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Timing

Outcome = list[Effect | NegotiationEvent]

#: Quick repeats of an award bridge lost frames; after these the winner is down, and a reminder at a tenth of the pace
#: is enough.
QUICK_AWARDS = 10
SLOW_DOWN = 10
#: The longest pace, in award repeats: 4 s at the default of 100 ms.
SLOWEST = 40

#: Steps and largest values of a sub-call's two durations on the wire (dbc/fleet.dbc, CallParent), in ms.
READY_STEP_MS, MAX_READY_MS = 100, 1_638_300
HOLD_STEP_MS, MAX_HOLD_MS = 250, 255_750


#: A winner that lives says so in less than this, us: its plan is one search and some frames.
ACCEPT_WITHIN_US = 5_000_000


def nobody_is(node: int) -> bool:
    """No machine is in the way."""
    return False


def is_any_sound(task: Reference, bid: Bid) -> bool:
    """Bids say nothing beyond their number that it could differ from."""
    return True


class InitiatorState(Enum):
    """Where an initiator stands with one task."""

    OPEN = "bids may come"
    HELD = "the best bid is an option"
    AWARDING = "the winner has not been heard yet"
    CLOSED = "over"


class InitiatorEvent(Enum):
    """What can happen to an initiator."""

    DEADLINE_WITH_BID = "the deadline has passed and there is a best bid"
    DEADLINE_EMPTY = "the deadline has passed without a bid, and attempts are left"
    EXHAUSTED = "the deadline has passed without a bid for the last time"
    REPEAT = "the award is to be said again"
    HEARD = "the winner was heard acting on the award"
    WITHDRAW = "the machine no longer wants the task done"
    DEADLINE_WITH_OPTION = "a sub-call's deadline has passed and there is a best bid"
    CONFIRM = "what the option hangs on was awarded"
    EXPIRE = "the option has ended undecided"
    FORFEIT = "the winner was heard giving the task back"
    ABANDON = "the winner is lost, and the custodian of the object awards anew"


@dataclass(frozen=True, slots=True)
class RestartStep:
    """How one attempt differs: its window in per cent of the site's, and terms replaced (None: as they were).

    The paper's "possibly after a modification" (row P12): more time, another entry or exit, another measure.
    """

    window_percent: int
    from_station: int | None = None
    to_station: int | None = None
    criterion: Criterion | None = None

    def changed(self, terms: RequestedTerms) -> RequestedTerms:
        """The terms of this attempt."""
        return replace(
            terms,
            from_station=terms.from_station if self.from_station is None else self.from_station,
            to_station=terms.to_station if self.to_station is None else self.to_station,
            criterion=terms.criterion if self.criterion is None else self.criterion,
        )


@dataclass(frozen=True, slots=True)
class RestartPolicy:
    """What happens when nobody answers, as data; the last step serves all further attempts up to the site's bound."""

    steps: tuple[RestartStep, ...] = (RestartStep(100), RestartStep(150), RestartStep(200), RestartStep(300))

    def step(self, attempt: int) -> RestartStep:
        """The step for attempt 1, 2, ..."""
        return self.steps[min(attempt, len(self.steps)) - 1]

    def window_us(self, attempt: int, timing: Timing) -> int:
        """Length of attempt 1, 2, ... in us."""
        return timing.call_window_us * self.step(attempt).window_percent // 100


@dataclass
class Initiator:
    """One task that this machine wants done. ``number`` hands out call numbers. All times are bus time in us.

    A sub-call before a bid has its only ``deadline_us``, and its best bid is an option until ``hold_until_us``.
    """

    node_id: int
    terms: RequestedTerms
    timing: Timing
    policy: RestartPolicy
    number: Callable[[], int]
    counters: Counters = field(default_factory=Counters)
    trust: Trust = field(default_factory=Trust)
    #: Whether a node's bids count for nothing, because it is in the way by its own word or by its silence.
    is_obstacle: Callable[[int], bool] = nobody_is
    #: Whether a bid goes with what its bidder said right before it, where a system's bids say more than a number.
    is_sound: Callable[[Reference, Bid], bool] = is_any_sound
    #: Of a sub-call: whom the call leaves out for which it is asked.
    left_out_above: frozenset[int] = frozenset()
    deadline_us: int | None = None
    hold_until_us: int = 0
    state: InitiatorState = InitiatorState.OPEN
    call: CallForProposals | None = None
    attempt: int = 0
    best: tuple[int, int] | None = None
    #: Every node's newest bid, and the nodes whose bids for this attempt do not count.
    bids: dict[int, int] = field(default_factory=dict)
    left_out: frozenset[int] = frozenset()
    #: Whose bids did not count in an attempt before: the next one leaves them out, or those whom they beat stay silent.
    of_no_account: set[int] = field(default_factory=set)
    floor: int | None = None
    due_us: int | None = None
    awards_sent: int = 0
    awarded_us: int = 0
    #: Of a round: its deadline only ends it; who opened it decides whether anything has changed.
    is_round: bool = False
    _lost_reason: Reason = Reason.NONE

    # --- events ------------------------------------------------------------------------------------------------

    def open(self, now_us: int) -> Outcome:
        """Send the call for the next attempt."""
        self.attempt += 1
        self.bids.clear()
        terms = self.policy.step(self.attempt).changed(self.terms)
        deadline_us = self.deadline_us
        if deadline_us is None:
            deadline_us = now_us + self.policy.window_us(self.attempt, self.timing)
        deadline_ms = to_bus_ms(deadline_us)
        self.due_us = from_bus_ms(deadline_ms, now_us)
        self.call = CallForProposals(
            self.node_id,
            self.number(),
            terms.task,
            terms.operation,
            terms.kind,
            terms.criterion,
            self.attempt,
            terms.depth,
            deadline_ms,
            terms.from_station,
            terms.to_station,
            terms.load,
            terms.load_mm,
            terms.parent,
            terms.part,
            _in_steps_ms(terms.ready_us - self.due_us, READY_STEP_MS, MAX_READY_MS),
            _in_steps_ms(self.hold_until_us - self.due_us, HOLD_STEP_MS, MAX_HOLD_MS),
        )
        self.floor = None if terms.floor is None else terms.floor(self.call, now_us)
        last = self.attempt >= self.timing.max_attempts
        trusted_not = self.trust.left_out(terms.task, now_us, last_attempt=last, kind=terms.kind)
        self.left_out = trusted_not | self.left_out_above | self.of_no_account
        before = [*left_out_words(self.node_id, self.call.call, self.left_out), *self.terms.detail]
        return [*(Send(message) for message in before), Send(self.call)]

    def on_bid(self, bid: Bid, now_us: int) -> Outcome:
        """A bid counts if received before the deadline minus the guard, by my own bus time (decision on flag 11)."""
        assert self.call is not None and self.due_us is not None
        if self.state is not InitiatorState.OPEN or now_us > cut_off_us(self.due_us, self.timing):
            self.counters.late_bids_ignored += 1
            return []
        no_account = bid.sender in self.left_out or self.is_obstacle(bid.sender) or self._is_below_floor(bid.cost)
        if no_account or not self.is_sound(self.terms.task, bid):
            self.counters.bids_of_no_account += 1
            self.of_no_account.add(bid.sender)
            return []
        self.bids[bid.sender] = bid.cost
        self.choose()
        return []

    def choose(self) -> None:
        """The best of the bids that count: whoever has become an obstacle since does not."""
        assert self.call is not None
        self.best = None
        for node, cost in self.bids.items():
            is_best = self.best is None or beats(cost, node, *self.best, self.call.criterion)
            if is_best and not self.is_obstacle(node):
                self.best = (cost, node)

    def _is_below_floor(self, cost: int) -> bool:
        """Whether a bid is better than anybody could be."""
        assert self.call is not None
        return self.floor is not None and is_below(cost, self.floor, self.call.criterion)

    def on_itinerary(self, itinerary: Itinerary, now_us: int) -> Outcome:
        """The winner's firm itinerary whose stamp names this call ends the award."""
        assert self.call is not None
        stamp = itinerary.stamp
        named = stamp.initiator == self.node_id and stamp.call == self.call.call & 0xFF
        if itinerary.grade is not Grade.FIRM or not named or self.best is None or itinerary.sender != self.best[1]:
            return []
        return self._fire(InitiatorEvent.HEARD, now_us)

    def on_report(self, report: TaskReport, now_us: int) -> Outcome:
        """A report on the task by its winner ends the award as well; one that gives the task back rejects it."""
        if self.best is None or report.sender != self.best[1] or report.task != self.terms.task:
            return []
        if report.phase in (TaskPhase.FORFEITED, TaskPhase.REFUSED):
            self._lost_reason = report.reason
            return self._fire(InitiatorEvent.FORFEIT, now_us)
        if self.terms.operation is Operation.RIDE and report.station != self.terms.from_station:
            # Of another ride of the same task: the word for this one is lost, or has not been heard yet.
            return []
        return self._fire(InitiatorEvent.HEARD, now_us)

    def confirm(self, now_us: int) -> Outcome:
        """What the option hangs on was awarded: award the option."""
        return self._fire(InitiatorEvent.CONFIRM, now_us)

    def withdraw(self, now_us: int) -> Outcome:
        """Close the call for nobody while it is open or an option; an award under way is not taken back."""
        return self._fire(InitiatorEvent.WITHDRAW, now_us)

    def abandon(self, reason: Reason, now_us: int) -> Outcome:
        """The winner was never heard and will not have the object: its custodian calls anew, under a raised version."""
        self._lost_reason = reason
        return self._fire(InitiatorEvent.ABANDON, now_us)

    def begin_anew(self, now_us: int) -> None:
        """A machine has come back: it may be the winner, and hears the award soon."""
        if self.state is InitiatorState.AWARDING and self.awards_sent > QUICK_AWARDS:
            self.awards_sent = QUICK_AWARDS + 1
            self.due_us = min(self.due_us or now_us, now_us + self.timing.award_repeat_us)

    def silent_winner(self, now_us: int) -> int:
        """The winner that was awarded the task long ago and has said nothing of it since; 0 for nobody."""
        is_late = self.state is InitiatorState.AWARDING and now_us - self.awarded_us >= ACCEPT_WITHIN_US
        return self.best[1] if is_late and self.best is not None else NOBODY

    def next_wake(self) -> int | None:
        """When ``wake`` has something to do, bus time in us."""
        return None if self.is_round and self.state is InitiatorState.OPEN else self.due_us

    def wake(self, now_us: int) -> Outcome:
        """Let the deadline pass, or say the award again."""
        if self.due_us is None or self.due_us > now_us:
            return []
        if self.state is InitiatorState.AWARDING:
            return self._fire(InitiatorEvent.REPEAT, now_us)
        if self.state is InitiatorState.HELD:
            return self._fire(InitiatorEvent.EXPIRE, now_us)
        return [] if self.is_round else self.conclude(now_us)

    def conclude(self, now_us: int) -> Outcome:
        """The time for bids is over: award, or open the call again, or give it up."""
        self.choose()
        if self.best is not None:
            option = self.deadline_us is not None
            return self._fire(
                InitiatorEvent.DEADLINE_WITH_OPTION if option else InitiatorEvent.DEADLINE_WITH_BID, now_us
            )
        last = self.attempt >= self.timing.max_attempts or self.deadline_us is not None
        return self._fire(InitiatorEvent.EXHAUSTED if last else InitiatorEvent.DEADLINE_EMPTY, now_us)

    def _fire(self, event: InitiatorEvent, now_us: int) -> Outcome:
        entry = TABLE.get((self.state, event))
        if entry is None:
            return []
        self.state, action = entry
        return action(self, now_us)

    # --- actions -----------------------------------------------------------------------------------------------

    def decide(self, now_us: int) -> Outcome:
        """The best bid has won; in the silent form everybody is taken to know that."""
        if self.timing.silent and not self.is_round:
            return self._fire(InitiatorEvent.HEARD, now_us)
        return self.award(now_us)

    def award(self, now_us: int) -> Outcome:
        """Say who has won.

        Never given up: a winner that is not heard may be working, so only custody rules may re-award (design, section
        4). A person is told once.
        """
        assert self.best is not None
        cost, winner = self.best
        if not self.awards_sent:
            self.awarded_us = now_us
            if not self.terms.depth:
                self.trust.given(self.terms.task, winner, cost, self.terms.criterion)
        self.awards_sent += 1
        slow = self.awards_sent - QUICK_AWARDS
        # Ever more slowly: what a winner that is down needs to hear it hears when it is back and asks.
        factor = min(SLOWEST, SLOW_DOWN << min(slow - 1, 10)) if slow > 0 else 1
        self.due_us = now_us + self.timing.award_repeat_us * factor
        outcome: Outcome = [Send(self._closing(winner, CallResult.AWARDED, Reason.NONE))]
        if self.awards_sent == QUICK_AWARDS + 1:
            task = self.terms.task
            outcome.append(Report(f"node {winner} was awarded task {task.origin}.{task.number} and is not heard"))
        return outcome

    def end(self, now_us: int) -> Outcome:
        """The call is over: somebody has the task."""
        assert self.best is not None
        return self._closed(self.best[1], CallResult.AWARDED, Reason.NONE)

    def reopen(self, now_us: int) -> Outcome:
        """Close this attempt for nobody and open the next."""
        return [Send(self._closing(NOBODY, CallResult.REOPENED, Reason.NO_BID)), *self.open(now_us)]

    def refuse(self, now_us: int) -> Outcome:
        """Nobody can do it: say so and why."""
        closing = self._closing(NOBODY, CallResult.REFUSED, Reason.NO_BID)
        return [Send(closing), *self._closed(NOBODY, CallResult.REFUSED, Reason.NO_BID)]

    def cancel(self, now_us: int) -> Outcome:
        """The task is no longer wanted: say WITHDRAWN, so that bidders give up what they keep for it."""
        closing = self._closing(NOBODY, CallResult.WITHDRAWN, Reason.CANCELLED)
        return [Send(closing), *self._closed(NOBODY, CallResult.WITHDRAWN, Reason.CANCELLED)]

    def hold(self, now_us: int) -> Outcome:
        """The best bid is an option: its bidder is told once; it holds it by its own belief if that is lost."""
        assert self.best is not None and self.call is not None and self.due_us is not None
        self.due_us += self.call.hold_ms * 1000
        return [Send(self._closing(self.best[1], CallResult.OPTION, Reason.NONE))]

    def take_up(self, now_us: int) -> Outcome:
        """The option becomes an award."""
        self.counters.options_confirmed += 1
        return self.award(now_us)

    def give_up(self, now_us: int) -> Outcome:
        """The option is not needed."""
        self.counters.options_given_up += 1
        return self.cancel(now_us)

    def expire(self, now_us: int) -> Outcome:
        """Nobody said in time what came of it: it lapses at its bidder in the same moment, without a frame."""
        self.counters.options_expired += 1
        return self._closed(NOBODY, CallResult.WITHDRAWN, Reason.LATE)

    def reject(self, now_us: int) -> Outcome:
        """The winner gave the task back, or was lost, before it was heard taking it on."""
        closing = self._closing(NOBODY, CallResult.REJECTED, self._lost_reason)
        return [Send(closing), *self._closed(NOBODY, CallResult.REJECTED, self._lost_reason)]

    def _closed(self, winner: int, result: CallResult, reason: Reason) -> Outcome:
        assert self.call is not None
        self.due_us = None
        return [Closed(self.call, winner, result, reason, self.attempt)]

    def _closing(self, winner: int, result: CallResult, reason: Reason) -> Award:
        assert self.call is not None
        return Award(self.node_id, self.call.call, winner, self.terms.task, self.terms.task_version, result, reason)


def _in_steps_ms(duration_us: int, step_ms: int, most_ms: int) -> int:
    """A duration in whole steps, rounded up; 0 for one that is over, the most that can be said for one too long."""
    return min(most_ms, -(-max(0, duration_us) // (step_ms * 1000)) * step_ms)


#: The whole protocol of an initiator: (state, event) to the next state and what is done on the way.
TABLE: dict[tuple[InitiatorState, InitiatorEvent], tuple[InitiatorState, Callable[[Initiator, int], Outcome]]] = {
    (InitiatorState.OPEN, InitiatorEvent.DEADLINE_WITH_BID): (InitiatorState.AWARDING, Initiator.decide),
    (InitiatorState.OPEN, InitiatorEvent.DEADLINE_EMPTY): (InitiatorState.OPEN, Initiator.reopen),
    (InitiatorState.OPEN, InitiatorEvent.EXHAUSTED): (InitiatorState.CLOSED, Initiator.refuse),
    (InitiatorState.OPEN, InitiatorEvent.WITHDRAW): (InitiatorState.CLOSED, Initiator.cancel),
    (InitiatorState.OPEN, InitiatorEvent.DEADLINE_WITH_OPTION): (InitiatorState.HELD, Initiator.hold),
    (InitiatorState.HELD, InitiatorEvent.CONFIRM): (InitiatorState.AWARDING, Initiator.take_up),
    (InitiatorState.HELD, InitiatorEvent.WITHDRAW): (InitiatorState.CLOSED, Initiator.give_up),
    (InitiatorState.HELD, InitiatorEvent.EXPIRE): (InitiatorState.CLOSED, Initiator.expire),
    (InitiatorState.AWARDING, InitiatorEvent.REPEAT): (InitiatorState.AWARDING, Initiator.award),
    (InitiatorState.AWARDING, InitiatorEvent.FORFEIT): (InitiatorState.CLOSED, Initiator.reject),
    (InitiatorState.AWARDING, InitiatorEvent.ABANDON): (InitiatorState.CLOSED, Initiator.reject),
    (InitiatorState.AWARDING, InitiatorEvent.HEARD): (InitiatorState.CLOSED, Initiator.end),
}

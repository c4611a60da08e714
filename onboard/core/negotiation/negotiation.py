"""All calls of one machine at once, in both roles (rows P02 to P04)."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from onboard.contract.codes import KindCode, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, LeftOut, Message, Reference, TaskReport
from onboard.core.effects import Effect
from onboard.core.negotiation.bidding import ANY_TIME, DelayRule, SpeakingSlot, delay_us, last_bid_us, slot_of
from onboard.core.negotiation.counters import Counters
from onboard.core.negotiation.events import Awarded, CallKey, Estimator, NegotiationEvent, PreAssigned, RequestedTerms
from onboard.core.negotiation.initiator import Initiator, InitiatorState, RestartPolicy, is_any_sound, nobody_is
from onboard.core.negotiation.participant import Participant
from onboard.core.negotiation.sub_calls import SubCalls
from onboard.core.negotiation.trust import Trust
from onboard.core.serial import from_bus_ms, is_newer, successor
from onboard.core.site import Machine, Site, Timing

#: A participation that is over, or in which this machine never bid, is forgotten this long after its deadline: frames
#: that wait in a queue longer than that are too late by the call's own deadline.
FORGET_US = 60_000_000
#: Most participations remembered at once. A fleet has tens of calls open, not hundreds.
MAX_CALLS = 256
#: No call is open for more of the site's call windows than this: one that ends later was told by a wrong clock.
MAX_WINDOWS = 60

Outcome = list[Effect | NegotiationEvent]


def never(call: CallForProposals) -> bool:
    """Every call is looked at when it is heard."""
    return False


@dataclass
class Negotiation:
    """Participants by call, initiators by own call number.

    ``boot``, 0 to 255, begins the call numbers, so that a machine that starts again does not use those of a moment
    ago. ``delay`` and ``slot`` say when to speak; without a slot, bids that are ready at one moment may cross.
    """

    node_id: int
    kind: KindCode
    timing: Timing
    estimator: Estimator
    policy: RestartPolicy = field(default_factory=RestartPolicy)
    counters: Counters = field(default_factory=Counters)
    participants: dict[CallKey, Participant] = field(default_factory=dict)
    initiators: list[Initiator] = field(default_factory=list)
    boot: int = 0
    delay: DelayRule = delay_us
    slot: SpeakingSlot = ANY_TIME
    trust: Trust = field(default_factory=Trust)
    #: Whether a node's bids count for nothing, by this machine's mirror.
    is_obstacle: Callable[[int], bool] = nobody_is
    #: Whether a bid for a task goes with what its bidder said right before it; a kind sets it where its bids say more.
    is_sound: Callable[[Reference, Bid], bool] = is_any_sound
    #: Whether a call stands: this machine looks at it in its initiator's rounds, and not when it is heard.
    stands: Callable[[CallForProposals], bool] = never
    #: Own calls that stand and are open in this round, by number, and the end of the round.
    _standing: Mapping[int, RequestedTerms] = field(default_factory=dict)
    _until_us: int = 0
    #: The newest word of each initiator about whom it leaves out: the call, and the nodes.
    _left_out: dict[int, tuple[int, frozenset[int]]] = field(default_factory=dict)
    _last_call: int = field(init=False)

    def __post_init__(self) -> None:
        self._last_call = (self.boot & 0xFF) << 8

    def open(self, terms: RequestedTerms, now_us: int) -> list[Effect]:
        """Call for a task. The answer comes as a ``Closed`` event from ``receive`` or ``wake``."""
        initiator = Initiator(
            self.node_id,
            terms,
            self.timing,
            self.policy,
            self._next_call,
            self.counters,
            self.trust,
            self.is_obstacle,
            self.is_sound,
        )
        self.initiators.append(initiator)
        return [item for item in initiator.open(now_us) if not isinstance(item, NegotiationEvent)]

    def withdraw(self, terms: RequestedTerms, now_us: int) -> Outcome:
        """Close the open call for a task, for nobody."""
        outcome: Outcome = []
        for initiator in self.initiators:
            if initiator.terms == terms:
                outcome += initiator.withdraw(now_us)
        self._forget(now_us)
        return outcome

    def call_off(self, task: Reference, reason: Reason, now_us: int) -> Outcome:
        """Nobody is to do a ``task`` of mine any more: its open call is withdrawn, an award under way given up."""
        withdrawn = [item for one in self.initiators if one.terms.task == task for item in one.withdraw(now_us)]
        return withdrawn + self.abandon(task, reason, now_us)

    def abandon(self, task: Reference, reason: Reason, now_us: int) -> Outcome:
        """Give up own awards for a ``task`` whose winner was not heard; see ``Initiator.abandon``."""
        outcome = [item for one in self.initiators if one.terms.task == task for item in one.abandon(reason, now_us)]
        self.trust.forfeited(task, now_us)
        self._forget(now_us)
        return outcome

    def begin_anew(self, now_us: int) -> None:
        """A machine has come back: what is said again slowly is said soon."""
        for initiator in self.initiators:
            initiator.begin_anew(now_us)

    def was_held(self, now_us: int) -> None:
        """I take part again: that somebody was silent while I was held, or asleep, says nothing of it."""
        for initiator in self.initiators:
            initiator.awarded_us = now_us

    def silent_winner(self, task: Reference, now_us: int) -> int:
        """Who was awarded a ``task`` of mine long ago and is not heard acting on it; 0 for nobody."""
        return max([one.silent_winner(now_us) for one in self.initiators if one.terms.task == task], default=NOBODY)

    def standing_bid(self, key: CallKey) -> tuple[int, int] | None:
        """Cost and node-ID of the best bid heard for another machine's call; after the deadline, the winner (P11).

        None where nobody has bid, or where the call is not known to this machine.
        """
        participant = self.participants.get(key)
        return participant.best if participant is not None else None

    # --- events ------------------------------------------------------------------------------------------------

    def receive(self, message: Message, now_us: int) -> Outcome:
        """A call, bid, award, itinerary or task report of another machine."""
        outcome: Outcome = []
        match message:
            case CallForProposals():
                outcome = self._on_call(message, now_us)
            case Bid():
                if message.initiator != self.node_id and not self.knows(message.initiator, message.call):
                    return []
                outcome = self._on_bid(message, now_us)
            case LeftOut():
                self._on_left_out(message)
            case Award():
                participant = self.participants.get(CallKey(message.sender, message.call))
                outcome = self._spread(participant.on_award(message, now_us), now_us) if participant is not None else []
            case Itinerary():
                for initiator in self.initiators:
                    outcome += initiator.on_itinerary(message, now_us)
            case TaskReport():
                for initiator in self.initiators:
                    outcome += initiator.on_report(message, now_us)
                self._judge(message, now_us)
        self._forget(now_us)
        return outcome

    def wake(self, now_us: int) -> Outcome:
        """Do what has fallen due in any call."""
        outcome: Outcome = []
        for participant in list(self.participants.values()):
            outcome += self._spread(participant.wake(now_us), now_us)
        for initiator in list(self.initiators):
            outcome += initiator.wake(now_us)
        for participant in list(self.participants.values()):
            outcome += self._spread(participant.collect(now_us), now_us)
        self._forget(now_us)
        return outcome

    def knows(self, initiator: int, call: int) -> bool:
        """Whether this node takes part in a call, or did a moment ago."""
        return (initiator, call) in self.participants

    def next_wake(self) -> int | None:
        """The earliest due time of all calls, bus time in us."""
        times = [participant.next_wake() for participant in self.participants.values()]
        times += [initiator.next_wake() for initiator in self.initiators]
        return min([time for time in times if time is not None], default=None)

    # --- calls that stand, round by round ------------------------------------------------------------------------

    def look(self, call: CallForProposals, round_us: tuple[int, int], heard: Iterable[Bid], now_us: int) -> None:
        """Take part in a call that stands, in a round from its begin to its end; ``heard`` are its bids so far."""
        since_us, until_us = round_us
        participant = self._participant(call, until_us, now_us)
        # Who wins a round is what its initiator makes of all its calls: that has to be said.
        participant.timing = replace(participant.timing, silent=False)
        self.participants[participant.key] = participant
        # Released and awarded calls are told as ever; before the first bid there is nothing to tell.
        participant.open(since_us)
        for bid in heard:
            participant.on_bid(bid, now_us)

    def leave_round(self, initiator: int) -> None:
        """A round of another's calls is over: what came of it was told, or is told by the next."""
        self.participants = {key: one for key, one in self.participants.items() if key.initiator != initiator}

    def begin_round(self, standing: Mapping[int, RequestedTerms], until_us: int) -> None:
        """Own calls, by number, were told to all and are open again until then: their bids count."""
        self.end_round()
        self._standing, self._until_us = standing, until_us

    def end_round(self) -> None:
        """What was not awarded in the round stands for the next."""
        self._standing = {}
        self.initiators = [one for one in self.initiators if not one.is_round]

    def best_of_round(self) -> dict[int, tuple[int, int]]:
        """Cost and node-ID of the best bid for each own call that has one, by number."""
        found = {}
        for one in self.initiators:
            if one.is_round and one.call is not None:
                one.choose()
                found[one.call.call] = one.best
        return {call: best for call, best in found.items() if best is not None}

    def award_in_round(self, call: int, now_us: int) -> list[Effect]:
        """The best bid for a call has won, and that is news."""
        for one in self.initiators:
            if one.is_round and one.call is not None and one.call.call == call and one.best is not None:
                return [item for item in one.conclude(now_us) if not isinstance(item, NegotiationEvent)]
        return []

    def _open_in_round(self, call: int, now_us: int) -> None:
        """With the first bid for a call that stands: it needs no other word."""
        terms = self._standing.get(call)
        begun = (one.call.call for one in self.initiators if one.is_round and one.call is not None)
        if terms is None or call in begun:
            return
        one = Initiator(
            self.node_id,
            terms,
            self.timing,
            self.policy,
            lambda: call,
            self.counters,
            self.trust,
            self.is_obstacle,
            self.is_sound,
            is_round=True,
        )
        one.open(now_us)
        one.due_us = self._until_us
        self.initiators.append(one)

    # --- calls of others ---------------------------------------------------------------------------------------

    def _on_call(self, call: CallForProposals, now_us: int) -> Outcome:
        whole = self.participants.get(CallKey(call.parent.origin, call.parent.number)) if call.hold_ms else None
        if whole is not None:
            whole.on_rival(from_bus_ms(call.deadline_ms, now_us))
        if call.kind not in (KindCode.ANY, self.kind):
            self.counters.calls_of_other_kind += 1
            return []
        if self.stands(call):
            return []
        key = CallKey(call.sender, call.call)
        known = self.participants.get(key)
        if known is not None and known.call == call:
            return []
        deadline_us = from_bus_ms(call.deadline_ms, now_us)
        if now_us >= last_bid_us(deadline_us, self.timing) or deadline_us > now_us + self._longest_us:
            self.counters.calls_too_late += 1
            return []
        older = [one for one in self.participants.values() if one.key == key or _is_for_same_task(one.call, call)]
        if any(one.deadline_us > deadline_us and not one.is_over and not _is_behind(one.call, call) for one in older):
            self.counters.calls_stale += 1
            return []
        outcome: Outcome = []
        for one in older:
            outcome += one.supersede(now_us)
        self.participants.pop(key, None)
        outcome += self._make_room(now_us)
        participant = self.participants[key] = self._participant(call, deadline_us, now_us)
        return outcome + participant.open(now_us)

    def _participant(self, call: CallForProposals, deadline_us: int, now_us: int) -> Participant:
        left_out = self._out_of(call)
        return Participant(
            self.node_id,
            call,
            self._timing_of(call, deadline_us - now_us),
            self.estimator,
            self.counters,
            deadline_us,
            SubCalls(call, deadline_us, self.timing, partial(self._open_sub_call, left_out)),
            self.delay,
            self.slot,
            self.is_obstacle,
            left_out,
            self.is_sound,
        )

    def _on_left_out(self, word: LeftOut) -> None:
        """Whom the next call of its sender leaves out; a second frame for the same call names more."""
        named = {word.node_a, word.node_b, word.node_c, word.node_d, word.node_e, word.node_f} - {NOBODY}
        call, nodes = self._left_out.get(word.sender, (word.call, frozenset()))
        self._left_out[word.sender] = word.call, (nodes if call == word.call else frozenset()) | named

    def _out_of(self, call: CallForProposals) -> frozenset[int]:
        number, nodes = self._left_out.get(call.sender, (call.call, frozenset()))
        return nodes if number == call.call else frozenset()

    def _judge(self, report: TaskReport, now_us: int) -> None:
        """What a winner says of its task is what it is worth in the next calls."""
        if self.trust.winner(report.task) != report.sender:
            # Of who has not won it, or has lost it since, it is no word about its worth.
            return
        if report.phase is TaskPhase.DONE:
            self.trust.done(report.task, report.sender, now_us)
        elif report.phase in (TaskPhase.FORFEITED, TaskPhase.REFUSED):
            self.trust.forfeited(report.task, now_us)

    @property
    def _longest_us(self) -> int:
        return MAX_WINDOWS * self.timing.call_window_us

    def _spread(self, outcome: Outcome, now_us: int) -> Outcome:
        """Tell all other participations of a bid or an award: their searches knew nothing of it."""
        for item in list(outcome):
            if isinstance(item, PreAssigned | Awarded):
                for key, participant in self.participants.items():
                    if key != item.call_key:
                        outcome += participant.on_change(now_us)
        return outcome

    def _timing_of(self, call: CallForProposals, window_us: int) -> Timing:
        """A sub-call before a bid ends sooner than other calls: its bidders speak sooner by the same ratio."""
        if not call.hold_ms or window_us >= self.timing.call_window_us:
            return self.timing
        return replace(self.timing, bid_delay_us=self.timing.bid_delay_us * window_us // self.timing.call_window_us)

    def _open_sub_call(
        self, left_out: frozenset[int], terms: RequestedTerms, deadline_us: int, hold_until_us: int, now_us: int
    ) -> tuple[Initiator, Outcome]:
        initiator = Initiator(
            self.node_id,
            terms,
            self.timing,
            self.policy,
            self._next_call,
            counters=self.counters,
            is_obstacle=self.is_obstacle,
            is_sound=self.is_sound,
            left_out_above=left_out,
            deadline_us=deadline_us,
            hold_until_us=hold_until_us,
        )
        self.initiators.append(initiator)
        return initiator, initiator.open(now_us)

    def _on_bid(self, bid: Bid, now_us: int) -> Outcome:
        if bid.initiator == self.node_id:
            self._open_in_round(bid.call, now_us)
            for initiator in self.initiators:
                if initiator.call is not None and initiator.call.call == bid.call:
                    return initiator.on_bid(bid, now_us)
            self.counters.late_bids_ignored += 1
            return []
        participant = self.participants.get(CallKey(bid.initiator, bid.call))
        return participant.on_bid(bid, now_us) if participant is not None else []

    def _make_room(self, now_us: int) -> Outcome:
        """Drop the oldest that is over, else the oldest that reserves nothing, else the oldest, which is told."""
        if len(self.participants) < MAX_CALLS:
            return []
        victim = min(self.participants.values(), key=lambda one: 0 if one.is_over else 1 + one.is_committed)
        del self.participants[victim.key]
        return victim.supersede(now_us)

    def _forget(self, now_us: int) -> None:
        self.initiators = [one for one in self.initiators if one.state is not InitiatorState.CLOSED]
        old = [
            key
            for key, one in self.participants.items()
            if now_us > one.deadline_us + FORGET_US and (one.is_over or not one.has_bid)
        ]
        for key in old:
            del self.participants[key]

    def _next_call(self) -> int:
        self._last_call = successor(self._last_call, 16)
        return self._last_call


def _is_behind(one: CallForProposals, other: CallForProposals) -> bool:
    """Whether ``other`` was opened after ``one`` by its number: a deadline tells less where a clock was set anew."""
    return one.sender == other.sender and is_newer(other.call, one.call, 16)


def _is_for_same_task(one: CallForProposals, other: CallForProposals) -> bool:
    """Whether two calls are attempts at one thing; parts of one task differ in operation, depth, part or for whom."""
    return _thing(one) == _thing(other)


def _thing(call: CallForProposals) -> tuple[object, ...]:
    return call.sender, call.task, call.operation, call.depth, call.part, call.parent.origin


def negotiation_of(
    site: Site, machine: Machine, estimator: Estimator, boot: int, is_obstacle: Callable[[int], bool]
) -> Negotiation:
    """That of a machine of a site, in its slot."""
    of_kind: dict[KindCode | None, set[int]] = {
        kind: {node for node, one in site.machines.items() if one.kind is kind} for kind in KindCode
    }
    negotiation = Negotiation(machine.node_id, machine.kind, site.timing, estimator, boot=boot, is_obstacle=is_obstacle)
    negotiation.slot = slot_of(site, machine.node_id)
    negotiation.trust.able = lambda kind: frozenset(node for node in of_kind.get(kind, ()) if not is_obstacle(node))
    return negotiation

"""All calls of one machine at once, in both roles (rows P02 to P04)."""

from dataclasses import dataclass, field

from onboard.core.codes import KindCode
from onboard.core.effects import Effect
from onboard.core.messages import Award, Bid, CallForProposals, Itinerary, Message, TaskReport
from onboard.core.negotiation.events import CallKey, CallTerms, Estimator, NegotiationEvent
from onboard.core.negotiation.initiator import Initiator, RestartPolicy
from onboard.core.negotiation.initiator import State as InitiatorState
from onboard.core.negotiation.participant import Counters, Participant, deadline_of
from onboard.core.serial import successor
from onboard.core.site import Timing

#: A participation is forgotten this long after its deadline: repeats of the award have ended by then.
FORGET_US = 60_000_000
#: Most participations remembered at once; beyond it the oldest goes. A fleet has tens of calls open, not hundreds.
MAX_CALLS = 256

Outcome = list[Effect | NegotiationEvent]


@dataclass
class Negotiation:
    """Participants by call, initiators by own call number. ``silent`` is the award-free form, for comparison only."""

    node_id: int
    kind: KindCode
    timing: Timing
    estimator: Estimator
    silent: bool = False
    policy: RestartPolicy = field(default_factory=RestartPolicy)
    counters: Counters = field(default_factory=Counters)
    participants: dict[CallKey, Participant] = field(default_factory=dict)
    initiators: list[Initiator] = field(default_factory=list)
    _last_call: int = 0

    def open(self, terms: CallTerms, now_us: int) -> list[Effect]:
        """Call for a task. The answer comes as a ``Closed`` event from ``receive`` or ``wake``."""
        initiator = Initiator(self.node_id, terms, self.timing, self.policy, self._next_call, self.silent)
        self.initiators.append(initiator)
        return [item for item in initiator.open(now_us) if not isinstance(item, NegotiationEvent)]

    def withdraw(self, terms: CallTerms, now_us: int) -> Outcome:
        """Close the open call for a task, for nobody."""
        outcome: Outcome = []
        for initiator in self.initiators:
            if initiator.terms == terms:
                outcome += initiator.withdraw(now_us)
        return outcome

    def receive(self, message: Message, now_us: int) -> Outcome:
        """A call, bid, award, itinerary or task report of another machine."""
        outcome: Outcome = []
        match message:
            case CallForProposals():
                outcome = self._on_call(message, now_us)
            case Bid():
                outcome = self._on_bid(message, now_us)
            case Award():
                participant = self.participants.get(CallKey(message.sender, message.call))
                outcome = participant.on_award(message, now_us) if participant is not None else []
            case Itinerary():
                for initiator in self.initiators:
                    outcome += initiator.on_itinerary(message, now_us)
            case TaskReport():
                for initiator in self.initiators:
                    outcome += initiator.on_report(message, now_us)
        self._forget(now_us)
        return outcome

    def wake(self, now_us: int) -> Outcome:
        """Do what has fallen due in any call."""
        outcome: Outcome = []
        for participant in list(self.participants.values()):
            outcome += participant.wake(now_us)
        for initiator in list(self.initiators):
            outcome += initiator.wake(now_us)
        self._forget(now_us)
        return outcome

    def next_wake(self) -> int | None:
        """The earliest due time of all calls, bus time in us."""
        times = [participant.next_wake() for participant in self.participants.values()]
        times += [initiator.due_us for initiator in self.initiators]
        due = [time for time in times if time is not None]
        return min(due) if due else None

    def _on_call(self, call: CallForProposals, now_us: int) -> Outcome:
        key = CallKey(call.sender, call.call)
        if key in self.participants:
            return []
        if call.kind not in (KindCode.ANY, self.kind):
            self.counters.calls_of_other_kind += 1
            return []
        deadline_us = deadline_of(call, now_us)
        participant = Participant(
            self.node_id, call, self.timing, self.estimator, self.counters, self.silent, deadline_us
        )
        self.participants[key] = participant
        if len(self.participants) > MAX_CALLS:
            del self.participants[next(iter(self.participants))]
        return participant.open(now_us)

    def _on_bid(self, bid: Bid, now_us: int) -> Outcome:
        if bid.initiator == self.node_id:
            for initiator in self.initiators:
                if initiator.call is not None and initiator.call.call == bid.call:
                    return initiator.on_bid(bid, now_us)
            return []
        participant = self.participants.get(CallKey(bid.initiator, bid.call))
        return participant.on_bid(bid, now_us) if participant is not None else []

    def _next_call(self) -> int:
        self._last_call = successor(self._last_call, 16)
        return self._last_call

    def _forget(self, now_us: int) -> None:
        self.initiators = [one for one in self.initiators if one.state is not InitiatorState.CLOSED]
        old = [key for key, one in self.participants.items() if now_us > one.deadline_us + FORGET_US]
        for key in old:
            del self.participants[key]

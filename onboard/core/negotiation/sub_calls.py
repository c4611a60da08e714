"""Sub-calls as options (design, section 4): what a bidder asks of others before it can name its own cost.

A sub-call carries its parent and a depth and ends well inside the outer deadline. Its best bid is an *option*: the
sub-winner keeps tentative reservations and nothing else, until the outer award is heard and the option is confirmed, or
until it lapses soon after the outer deadline. An option never moves a machine. The asked may ask others in turn.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from onboard.contract.constants import NOBODY
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.effects import Effect
from onboard.core.negotiation.bidding import last_bid_us
from onboard.core.negotiation.events import NegotiationEvent, RequestedTerms, SubCallAnswer
from onboard.core.negotiation.initiator import Initiator, InitiatorState
from onboard.core.site import Timing

Outcome = list[Effect | NegotiationEvent]

#: Deepest sub-call: a call of its own has depth 0.
MAX_DEPTH = 7
#: Most sub-calls of one bid, over all rounds: the part number has 4 bits on the wire.
MAX_PARTS = 15
#: An option outlasts what it hangs on by this many award repeats: a lost award is said again before that.
HOLD_REPEATS = 10

#: Opens a sub-call: terms, deadline, end of the option, now (bus us).
Open = Callable[[RequestedTerms, int, int, int], tuple[Initiator, Outcome]]


def inner_deadline_us(outer_deadline_us: int, now_us: int, timing: Timing) -> int | None:
    """When a sub-call opened now ends; None where too little time is left for anybody to answer it.

    The least window is four guards: two that end the bidding early, two in which to bid.
    """
    window_us = (last_bid_us(outer_deadline_us, timing) - now_us) * timing.sub_call_percent // 100
    return now_us + window_us if window_us >= 4 * timing.deadline_guard_us else None


def hold_until_us(call: CallForProposals, deadline_us: int, timing: Timing) -> int:
    """How long options for a bid in ``call`` are held: each level outlasts the one that it hangs on."""
    return deadline_us + call.hold_ms * 1000 + HOLD_REPEATS * timing.award_repeat_us


@dataclass
class SubCalls:
    """The sub-calls of one bid in ``call``, which ends at ``deadline_us``, by part number. Idle until ``ask``."""

    call: CallForProposals
    deadline_us: int
    timing: Timing
    open: Open
    asked: dict[int, Initiator] = field(default_factory=dict)
    _before: int = 0

    def ask(self, parts: tuple[RequestedTerms, ...], now_us: int) -> Outcome | None:
        """Open a sub-call for each part; None where depth, part numbers or time do not allow any."""
        if not parts:
            return []
        deadline_us = inner_deadline_us(self.deadline_us, now_us, self.timing)
        if deadline_us is None or self.call.depth >= MAX_DEPTH or len(self.asked) + len(parts) > MAX_PARTS:
            return None
        outcome: Outcome = []
        until_us = hold_until_us(self.call, self.deadline_us, self.timing)
        for terms in parts:
            number = len(self.asked) + 1
            parent = Reference(self.call.sender, self.call.call)
            part = replace(terms, parent=parent, part=number, depth=self.call.depth + 1)
            self.asked[number], said = self.open(part, deadline_us, until_us, now_us)
            outcome += said
        return outcome

    def may_ask(self, now_us: int) -> bool:
        """Whether sub-calls that open at ``now_us`` leave anybody the time to answer."""
        return inner_deadline_us(self.deadline_us, now_us, self.timing) is not None

    @property
    def is_answered(self) -> bool:
        """Whether every sub-call has come to its deadline."""
        return all(one.state is not InitiatorState.OPEN for one in self.asked.values())

    def answers(self) -> tuple[SubCallAnswer, ...]:
        """The answers so far, in the order of part numbers."""
        return tuple(
            _answer(number, one)
            for number, one in self.asked.items()
            if number > self._before and one.state is not InitiatorState.OPEN
        )

    def begin_anew(self, now_us: int) -> Outcome:
        """Give up all that was asked: the search that asked was stale, so are its answers."""
        self._before = len(self.asked)
        return self.drop(now_us)

    def confirm(self, parts: Iterable[int], now_us: int) -> tuple[tuple[SubCallAnswer, ...], Outcome]:
        """Award the options that the bid rests on; those that have lapsed are not among the answers."""
        held = [number for number in parts if self.asked[number].state is InitiatorState.HELD]
        outcome: Outcome = []
        for number in held:
            outcome += self.asked[number].confirm(now_us)
        return tuple(_answer(number, self.asked[number]) for number in held), outcome

    def drop(self, now_us: int, keep: tuple[int, ...] = ()) -> Outcome:
        """Close all that are not to be kept: open ones and options are given up in one frame each."""
        outcome: Outcome = []
        for number, one in self.asked.items():
            if number not in keep:
                outcome += one.withdraw(now_us)
        return outcome


def _answer(number: int, asked: Initiator) -> SubCallAnswer:
    cost, winner = asked.best if asked.best is not None else (0, NOBODY)
    return SubCallAnswer(number, asked.terms, winner, cost)

"""What the negotiation tells its machine, and what it asks of the machine's task-generation function."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.contract.messages import NO_REFERENCE, Award, CallForProposals, Itinerary, Message, Reference


class CallKey(NamedTuple):
    """A call: its initiator's node-ID and call number."""

    initiator: int
    call: int


class Proposal(NamedTuple):
    """What a task would cost: ``cost`` in the call's unit, the tentative itinerary, and the kind's own data.

    ``parts`` are the sub-calls whose options it rests on, by number; the others are given up when it is bid. ``detail``
    is what a system's bids say beyond the number: said right before the bid.
    """

    cost: int
    itinerary: Itinerary | None
    program: tuple[Any, ...]
    alternatives: tuple[Any, ...]
    parts: tuple[int, ...] = ()
    detail: tuple[Message, ...] = ()
    #: What the bid names where it rests on no itinerary: the round of a call that stands.
    version: int = 0
    #: Whether it still holds at a bus time, us, where finding it took so long that it may not: else it is not said.
    stands: "Callable[[int], bool] | None" = None


@dataclass(frozen=True, slots=True)
class RequestedTerms:
    """What an initiator asks for; the negotiation adds call number, attempt and deadline.

    ``ready_us`` (bus time) is when a part can begin at the earliest, 0 for at once. The negotiation numbers the parts
    of a bid itself: ``parent``, ``part`` and ``depth`` are for calls that a machine opens after winning. ``detail`` is
    what a system's tasks need beyond a call's fields: said right before the call, each time that it is opened.
    ``load`` is what the task is about, and ``load_mm`` the one length of it that who carries it must know, 0 for none.
    """

    task: Reference
    operation: Operation
    kind: KindCode
    criterion: Criterion
    from_station: int
    to_station: int
    load: Reference
    load_mm: int
    task_version: int = 1
    depth: int = 0
    parent: Reference = NO_REFERENCE
    part: int = 0
    ready_us: int = 0
    detail: tuple[Message, ...] = ()
    #: What nobody can be better than, where the initiator knows it: a bid below it is no bid.
    floor: Callable[[CallForProposals, int], int] | None = field(default=None, compare=False)


class SubCallAnswer(NamedTuple):
    """What came of a sub-call: its number and terms, the best bid's ``cost``, and its ``winner``, 0 for nobody."""

    part: int
    terms: RequestedTerms
    winner: int
    cost: int


class NeededAnswers(NamedTuple):
    """The cost cannot be named before others have answered ``parts``; it will be ``cost`` or more, as far as is known.

    ``combine`` gets all answers so far, of earlier rounds too, and the time (bus us): the proposal, or what else is
    needed, or None where there is no solution with these answers. Without ``parts`` it is a search that goes on so.
    """

    cost: int
    parts: tuple[RequestedTerms, ...]
    combine: "Callable[[tuple[SubCallAnswer, ...], int], Proposal | NeededAnswers | None]"


class Estimator(Protocol):
    """A task-generation function as the protocol sees it (rows P20 to P22). Costs are in the call's unit.

    Finishing times are bus ms modulo 2**32, as in a bid.
    """

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """A cost below which nobody can be, computed from call and site alone: equal on every machine."""

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """A cheap bound of this machine's cost; None where it cannot do the task at all."""

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        """The real cost around everybody's plans, or what must be asked first; None where there is no solution."""


@dataclass(frozen=True, slots=True)
class PreAssigned:
    """This machine's bid stands best: it is committed until outbid (row P10)."""

    call_key: CallKey
    call: CallForProposals
    proposal: Proposal


@dataclass(frozen=True, slots=True)
class Released:
    """This machine is no longer committed to a call."""

    call_key: CallKey
    call: CallForProposals
    proposal: Proposal
    reason: Reason


@dataclass(frozen=True, slots=True)
class Awarded:
    """The task is this machine's. ``award`` is None in the silent form, where the deadline alone decides.

    ``parts`` are the options that the bid rests on and that are confirmed now; one that has lapsed is missing.
    """

    call_key: CallKey
    call: CallForProposals
    proposal: Proposal
    award: Award | None
    parts: tuple[SubCallAnswer, ...] = ()


@dataclass(frozen=True, slots=True)
class AwardedAgain:
    """The award of a call that this machine has won is said again: its initiator has not heard it act."""

    call_key: CallKey
    call: CallForProposals


@dataclass(frozen=True, slots=True)
class Closed:
    """An own call is over: ``winner`` (0 for nobody), and after how many ``attempts``."""

    call: CallForProposals
    winner: int
    result: CallResult
    reason: Reason
    attempts: int


NegotiationEvent = PreAssigned | Released | Awarded | AwardedAgain | Closed
EVENT_TYPES = (PreAssigned, Released, Awarded, AwardedAgain, Closed)

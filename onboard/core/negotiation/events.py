"""What the negotiation tells its machine, and what it asks of the machine's task-generation function."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from onboard.core.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.core.messages import Award, CallForProposals, Itinerary, Reference


class CallKey(NamedTuple):
    """A call: its initiator's node-ID and call number."""

    initiator: int
    call: int


class Proposal(NamedTuple):
    """What a task would cost: ``cost`` in the call's unit, the tentative itinerary, and the kind's own data."""

    cost: int
    itinerary: Itinerary | None
    program: tuple[Any, ...]
    alternatives: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class CallTerms:
    """What an initiator asks for; the negotiation adds call number, attempt and deadline."""

    task: Reference
    operation: Operation
    kind: KindCode
    criterion: Criterion
    from_station: int
    to_station: int
    car: Reference
    wheelbase_mm: int
    task_version: int = 1
    depth: int = 0


class Estimator(Protocol):
    """A task-generation function as the protocol sees it (rows P20 to P22). Costs are in the call's unit.

    Finishing times are bus ms modulo 2**32, as in a bid.
    """

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """A cost below which nobody can be, computed from call and site alone: equal on every machine."""

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """A cheap bound of this machine's cost; None where it cannot do the task at all."""

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The real cost around everybody's plans; None where there is no solution."""


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
    """The task is this machine's. ``award`` is None in the silent form, where the deadline alone decides."""

    call_key: CallKey
    call: CallForProposals
    proposal: Proposal
    award: Award | None


@dataclass(frozen=True, slots=True)
class Closed:
    """An own call is over: ``winner`` (0 for nobody), and after how many ``attempts``."""

    call: CallForProposals
    winner: int
    result: CallResult
    reason: Reason
    attempts: int


NegotiationEvent = PreAssigned | Released | Awarded | Closed
EVENT_TYPES = (PreAssigned, Released, Awarded, Closed)

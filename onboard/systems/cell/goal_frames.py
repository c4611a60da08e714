"""Goals and offers as messages, and back: what of them does not fit into a call or a bid."""

from dataclasses import dataclass, field
from typing import TypeVar

from onboard.contract.cell import (
    GoalEnd,
    GoalPath,
    GoalStart,
    GoalTerms,
    MoveCostHigh,
    MoveCostLow,
    MoveFrom,
    MoveTo,
    OfferHigh,
    OfferLow,
    OfferNodes,
    OfferNodesMore,
)
from onboard.contract.messages import Bid, CallForProposals, Message, Reference
from onboard.systems.cell.contracts import Contract, Goal
from onboard.systems.cell.fields import IN_OFFER, IN_PATH, MAX_CHAIN, from_halves, halves, offered_by, padded, path_of
from onboard.systems.cell.geometry import Point

#: Most goals and offers remembered of others; the oldest go first. A goal is called for right after it is told.
MAX_KNOWN = 256

_Key = TypeVar("_Key")
_Kind = TypeVar("_Kind", bound=Message)

GoalMessage = GoalStart | GoalEnd | GoalTerms | GoalPath
OfferMessage = OfferHigh | OfferLow | OfferNodes | OfferNodesMore


def goal_messages(goal: Goal) -> tuple[Message, ...]:
    """What is said before each call for a goal."""
    manager, number = goal.task
    return (
        GoalStart(manager, number, *goal.start),
        GoalEnd(manager, number, *goal.end),
        GoalTerms(manager, number, goal.time_limit_ms, goal.level, goal.deepest),
        GoalPath(manager, number, *padded(goal.path[:IN_PATH], IN_PATH)),
    )


def offer_messages(contract: Contract) -> tuple[Message, ...]:
    """What is said before each bid for a goal."""
    high, low = halves(contract.cost)
    name = (contract.node, *contract.goal.task)
    first, rest = contract.nodes[:IN_OFFER], contract.nodes[IN_OFFER:]
    said = OfferHigh(*name, high), OfferLow(*name, low), OfferNodes(*name, *padded(first, IN_OFFER))
    if len(first) < IN_OFFER:
        return said
    return (*said, OfferNodesMore(*name, *padded(rest, MAX_CHAIN - IN_OFFER)))


def contract_messages(contract: Contract) -> tuple[Message, ...]:
    """What a robot says of a contract that it has won: its own moves and what they cost (row C21)."""
    high, low = halves(contract.own_cost)
    task = contract.goal.task
    return (
        MoveFrom(contract.node, *task, *contract.move.approach[0]),
        MoveTo(contract.node, *task, *contract.move.via),
        MoveCostHigh(contract.node, *task, high),
        MoveCostLow(contract.node, *task, low),
    )


@dataclass(frozen=True, slots=True)
class ReceivedOffer:
    """An offer as its frames tell it."""

    cost: float
    nodes: tuple[int, ...]


@dataclass
class GoalsHeard:
    """What one machine has heard of others' goals (by task) and offers (by bidder and task). Whole sets only count."""

    _goals: dict[Reference, dict[type[Message], GoalMessage]] = field(default_factory=dict)
    _offers: dict[tuple[int, Reference], dict[type[Message], OfferMessage]] = field(default_factory=dict)

    def hear(self, message: Message) -> None:
        """Take up a frame of a goal or an offer; the first frame of a set begins it anew."""
        match message:
            case GoalStart() | GoalEnd() | GoalTerms() | GoalPath():
                goal = Reference(message.sender, message.goal)
                _take(self._goals, goal, message, isinstance(message, GoalStart))
            case OfferHigh() | OfferLow() | OfferNodes() | OfferNodesMore():
                offer = (message.sender, Reference(message.manager, message.goal))
                _take(self._offers, offer, message, isinstance(message, OfferHigh))

    def goal(self, call: CallForProposals) -> Goal | None:
        """The goal that a call is for; None where frames of it are missing or do not fit together."""
        frames = self._goals.get(call.task, {})
        start, end, terms, path = (frames.get(kind) for kind in (GoalStart, GoalEnd, GoalTerms, GoalPath))
        if not (
            isinstance(start, GoalStart)
            and isinstance(end, GoalEnd)
            and isinstance(terms, GoalTerms)
            and isinstance(path, GoalPath)
        ):
            return None
        nodes = path_of(path, terms.level)
        if len(nodes) != terms.level:
            return None
        places = Point(start.x_mm, start.y_mm), Point(end.x_mm, end.y_mm)
        return Goal(call.task, call.car, *places, nodes, terms.time_limit_ms, terms.deepest)

    def offer(self, bidder: int, task: Reference) -> ReceivedOffer | None:
        """A bidder's offer for a goal; None where frames of it are missing, or it names no cost of 0 or more."""
        frames = self._offers.get((bidder, task), {})
        high, low, nodes = (frames.get(kind) for kind in (OfferHigh, OfferLow, OfferNodes))
        if not (isinstance(high, OfferHigh) and isinstance(low, OfferLow) and isinstance(nodes, OfferNodes)):
            return None
        more = frames.get(OfferNodesMore)
        every = offered_by(nodes, more if isinstance(more, OfferNodesMore) else None)
        cost = from_halves(high.bits, low.bits)
        # Not a number, and infinite, are no costs either.
        return ReceivedOffer(cost, every) if every and 0 <= cost < float("inf") else None

    def is_sound(self, task: Reference, bid: Bid) -> bool:
        """Whether a bid is what its offer costs: one without its offer could not be a part of another's."""
        offer = self.offer(bid.sender, task)
        return offer is not None and bid.cost == cost_of_bid(offer.cost)


def cost_of_bid(cost: float) -> int:
    """An offer's cost as its bid tells it: thousandths of the paper's unit."""
    return round(1000 * cost)


def _take(table: dict[_Key, dict[type[Message], _Kind]], key: _Key, message: _Kind, begins: bool) -> None:
    if begins:
        table.pop(key, None)
        if len(table) >= MAX_KNOWN:
            del table[next(iter(table))]
        table[key] = {}
    if key in table:
        table[key][type(message)] = message

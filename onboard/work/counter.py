"""What every order desk does: hear orders at its counter, call for each, hear of completion, answer the counter.

A desk is an initiator and nothing else: it bids for nothing. Of an order it journals how it stands, so that a restart
calls for nothing twice: it listens first, because whoever has an order in hand says so.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar, Generic, TypeVar

from onboard.core.behaviour import Fleet
from onboard.core.codes import NOBODY, CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.messages import Message, Reference, SyncRequest, TaskReport
from onboard.core.negotiation import CallTerms, Closed, NegotiationEvent
from onboard.core.negotiation.winners import STANDS_AFTER_US

#: After power-up a desk listens so long before it calls: who has an order in hand says so. Ours.
LISTEN_US = 3_000_000
#: The counter is told how an order stands this often, us (dbc/cell.dbc, dbc/turning.dbc).
ANSWER_US = 2_000_000


class OrderState(Enum):
    """How an order stands; each is journalled."""

    HEARD = "not called for yet"
    CALLED = "bids may come"
    IN_HAND = "somebody has it"
    DONE = "done"
    REFUSED = "nobody can do it"


#: States that nothing follows.
OVER = (OrderState.DONE, OrderState.REFUSED)


@dataclass
class CounterOrder:
    """One order under its task's name. ``winner`` is a node-ID, 0 for nobody yet; ``calls`` were made so far."""

    task: Reference
    state: OrderState = field(default=OrderState.HEARD, kw_only=True)
    winner: int = field(default=NOBODY, kw_only=True)
    calls: int = field(default=0, kw_only=True)
    answer_at_us: int | None = field(default=None, kw_only=True)
    ask_at_us: int | None = field(default=None, kw_only=True)
    #: Whether a call of an earlier life of the desk may have found a winner that the desk has forgotten.
    may_be_won: bool = field(default=False, kw_only=True)

    @property
    def told(self) -> str:
        """How it stands in the words of a counter: RECEIVED, IN_HAND, DONE or REFUSED."""
        return "RECEIVED" if self.state in (OrderState.HEARD, OrderState.CALLED) else self.state.name


AnOrder = TypeVar("AnOrder", bound=CounterOrder)


@dataclass
class Counter(ABC, Generic[AnOrder]):
    """One desk. ``orders`` by name, in the order in which they came."""

    #: Who has an order in hand is asked how it stands this often, us.
    ask_us: ClassVar[int]
    #: An order that nobody can do is refused after so many calls of several attempts each.
    max_calls: ClassVar[int]

    fleet: Fleet
    kind: KindCode = KindCode.DESK
    orders: dict[Reference, AnOrder] = field(default_factory=dict)
    _listen_until_us: int | None = None

    def __post_init__(self) -> None:
        for entry in self.fleet.entries:
            if entry.get("record") == "order":
                order = self.noted_order(entry)
                self.orders[order.task] = order
            elif entry.get("record") == "order_state":
                self._replay(self.orders[Reference(self.fleet.node_id, int(entry["number"]))], entry)

    # --- what differs from desk to desk ------------------------------------------------------------------------

    @abstractmethod
    def terms(self, order: AnOrder) -> CallTerms:
        """The call by which this order finds its machine."""

    @abstractmethod
    def price(self, order: AnOrder) -> None:
        """Note what the winner asks for an order."""

    @abstractmethod
    def price_entry(self, order: AnOrder) -> Mapping[str, str | int]:
        """The price as the journal keeps it."""

    @abstractmethod
    def noted_price(self, order: AnOrder, entry: Mapping[str, str | int]) -> None:
        """Take the price from the journal."""

    @abstractmethod
    def noted_order(self, entry: Mapping[str, str | int]) -> AnOrder:
        """An order from the journal."""

    @abstractmethod
    def answer(self, order: AnOrder) -> Message:
        """What the counter is told of an order."""

    @abstractmethod
    def on_report(self, order: AnOrder, report: TaskReport, now_us: int) -> list[Effect]:
        """Somebody says how an order stands that is not over."""

    @abstractmethod
    def may_take_back(self, order: AnOrder) -> bool:
        """Whether an order that its winner does not carry out may go to another: it is not begun, by all I know."""

    def stands_us(self, order: AnOrder) -> int:
        """How long its winner may tell no change."""
        return STANDS_AFTER_US

    def in_turn(self, waiting: Iterable[AnOrder]) -> Iterable[AnOrder]:
        """The order in which to call; as they came."""
        return waiting

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """What the heartbeat says: IDLE once every order is over, else WORKING."""
        return MachineState.IDLE if all(o.state in OVER for o in self.orders.values()) else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """0: a desk has no plan of where to go."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Listen first: orders of an earlier life may be in hand."""
        self._listen_until_us = now_us + LISTEN_US
        for order in self.orders.values():
            order.answer_at_us = now_us
            order.ask_at_us = now_us + LISTEN_US if order.state is OrderState.IN_HAND else None
            if order.state is OrderState.IN_HAND:
                self.fleet.winners.takes(order.task, order.winner, now_us, stands_us=self.stands_us(order))
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Reports about orders of mine, by machines that can carry one out."""
        if not isinstance(message, TaskReport):
            return []
        machine = self.fleet.site.machines.get(message.sender)
        if machine is None or machine.kind is self.kind:
            self.fleet.drops[Reason.NOT_OF_KIND] += 1
            return []
        order = self.orders.get(message.task)
        if order is None or order.state in OVER:
            return []
        in_hand = order.state is OrderState.IN_HAND
        if message.sender == order.winner if in_hand else self._may_claim(order, message, now_us):
            return self.on_report(order, message, now_us)
        # Who has lost it, or never won it, says nothing that counts.
        is_claim = message.phase is TaskPhase.AWARDED
        return self.fleet.winners.remind(order.task, message.sender) if is_claim else []

    def _may_claim(self, order: AnOrder, report: TaskReport, now_us: int) -> bool:
        return order.may_be_won and self.fleet.winners.may_claim(order.task, report.sender, now_us)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A call is over: somebody has the order, or nobody."""
        if not isinstance(event, Closed) or event.call.task not in self.orders:
            return []
        order = self.orders[event.call.task]
        if order.state is not OrderState.CALLED:
            return []
        if event.winner:
            return self.put_in_hand(order, event.winner, now_us, event.call.call)
        refused = event.result is CallResult.REFUSED and order.calls >= self.max_calls
        return self.put(order, OrderState.REFUSED if refused else OrderState.HEARD, now_us)

    def advance(self, now_us: int) -> list[Effect]:
        """Call for orders, answer the counter, ask who has one in hand."""
        effects = self._take_back(now_us)
        if self._listen_until_us is not None and self._listen_until_us <= now_us:
            self._listen_until_us = None
        if self._listen_until_us is None:
            for order in self.in_turn([one for one in self.orders.values() if one.state is OrderState.HEARD]):
                order.calls += 1
                effects += self.put(order, OrderState.CALLED, now_us)
                effects += self.fleet.negotiation.open(self.terms(order), now_us)
        for order in self.orders.values():
            if order.answer_at_us is not None and order.answer_at_us <= now_us:
                effects += self.say(order, now_us)
            if order.ask_at_us is not None and order.ask_at_us <= now_us:
                order.ask_at_us = now_us + self.ask_us
                effects.append(Send(SyncRequest(self.fleet.node_id, order.winner)))
        return effects

    def next_wake(self) -> int | None:
        """When something is to be said or called."""
        times = [self._listen_until_us]
        for order in self.orders.values():
            times += [order.answer_at_us, order.ask_at_us]
        return min((time for time in times if time is not None), default=None)

    # --- orders ------------------------------------------------------------------------------------------------

    def won_unheard(self, order: AnOrder, winner: int, now_us: int) -> list[Effect]:
        """It has won a call that I do not remember, or whose award it has heard sooner than I its word."""
        said = self.fleet.negotiation.withdraw(self.terms(order), now_us)
        effects: list[Effect] = [item for item in said if not isinstance(item, NegotiationEvent)]
        return effects + self.put_in_hand(order, winner, now_us)

    def _take_back(self, now_us: int) -> list[Effect]:
        """Orders whose winners are lost are called for anew, without those."""
        effects: list[Effect] = []
        for order in self.orders.values():
            if order.state not in (OrderState.CALLED, OrderState.IN_HAND):
                continue
            reason = self.fleet.winners.lost(order.task, now_us)
            if reason is not Reason.NONE and not self.may_take_back(order):
                self.fleet.winners.keeps(order.task)
            elif reason is not Reason.NONE:
                effects += self.fleet.winners.take_back(order.task, reason, now_us)
                # That somebody failed in it says nothing of the others.
                order.calls = 0
                effects += self.put(order, OrderState.HEARD, now_us)
        return effects

    def put_in_hand(self, order: AnOrder, winner: int, now_us: int, call: int = 0) -> list[Effect]:
        """Somebody has it, by ``call`` where it is known."""
        order.winner, order.may_be_won = winner, False
        self.fleet.winners.takes(order.task, winner, now_us, call, self.stands_us(order))
        self.price(order)
        return self.put(order, OrderState.IN_HAND, now_us)

    def put(self, order: AnOrder, state: OrderState, now_us: int) -> list[Effect]:
        """Note how an order stands, and tell the counter."""
        order.state = state
        if state in OVER:
            self.fleet.winners.over(order.task)
        order.ask_at_us = now_us + self.ask_us if state is OrderState.IN_HAND else None
        entry: dict[str, str | int] = {"record": "order_state", "number": order.task.number, "state": state.name}
        return [Record({**entry, "winner": order.winner, **self.price_entry(order)}), *self.say(order, now_us)]

    def say(self, order: AnOrder, now_us: int) -> list[Effect]:
        """Tell the counter, and again until the order is over."""
        order.answer_at_us = None if order.state in OVER else now_us + ANSWER_US
        return [Actuate(self.answer(order))]

    def _replay(self, order: AnOrder, entry: Mapping[str, str | int]) -> None:
        state = OrderState[str(entry["state"])]
        # A call does not outlive its desk: it is made again, unless somebody says that it has the order.
        order.state = OrderState.HEARD if state is OrderState.CALLED else state
        order.may_be_won = state is OrderState.CALLED
        order.winner = int(entry["winner"])
        self.noted_price(order, entry)

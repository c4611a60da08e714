"""What every order desk does: hear orders at its counter, call for each, hear of completion, answer the counter.

A desk is an initiator and nothing else: it bids for nothing. Of an order it journals how it stands, so that a restart
calls for nothing twice: it listens first, because whoever has an order in hand says so.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

from onboard.contract.codes import CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.contract.messages import Heartbeat, ManualState, Message, Reference, SyncRequest, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.journal_records import JournalRecord
from onboard.core.negotiation import Closed, NegotiationEvent, RequestedTerms
from onboard.core.negotiation.winners import STANDS_AFTER_US
from onboard.work.manual import says_held
from onboard.work.order_life import NEXT, OrderEvent, OrderState, WorkOrder
from onboard.work.told_once import ToldOnce

#: After power-up a desk listens so long before it calls, us: who has an order in hand says so with its first signs of
#: life.
LISTEN_US = 3_000_000
#: A desk that hears nobody at all calls again after this, us: somebody who mends a cable takes longer.
CUT_OFF_US = 10_000_000
#: A desk that is alone on its bus looks again after this whether somebody lives, us: a heartbeat period.
ALONE_US = 2_000_000
#: While a person holds a machine, what nobody else can do is called for again after this, us: it may be let go.
HELD_US = 10_000_000
#: The counter is told how an order stands this often, us (dbc/cell.dbc, dbc/graph.dbc, dbc/turning.dbc).
ANSWER_US = 2_000_000

AnOrder = TypeVar("AnOrder", bound=WorkOrder)


@dataclass
class OrderDesk(ABC, Generic[AnOrder]):
    """One desk. ``orders`` by name, in the order in which they came."""

    #: The kind of machine that carries orders out.
    takers: ClassVar[KindCode]
    #: Who has an order in hand is asked how it stands this often, us.
    ask_us: ClassVar[int]
    #: An order that nobody can do is refused after so many calls of several attempts each; None for never.
    max_calls: ClassVar[int | None] = None
    #: After a call that nobody could do it is called for again after this, us.
    call_again_us: ClassVar[int] = 0

    fleet: Fleet
    kind: KindCode = KindCode.DESK
    orders: dict[Reference, AnOrder] = field(default_factory=dict)
    _listen_until_us: int | None = None
    #: Machines that stand in a person's hand, and orders for which nobody bid when they were last called for.
    _held: set[int] = field(default_factory=set)
    _refused: set[Reference] = field(default_factory=set)
    _told: ToldOnce = field(default_factory=ToldOnce)

    def __post_init__(self) -> None:
        self.replay()

    # --- what differs from desk to desk ------------------------------------------------------------------------

    @abstractmethod
    def replay(self) -> None:
        """Take up orders from the journal; ``take_up`` for each state of one."""

    @abstractmethod
    def order_record(self, order: AnOrder) -> JournalRecord:
        """The order as it came in, for the journal; written before anybody is told that it is in hand."""

    @abstractmethod
    def state_record(self, order: AnOrder) -> JournalRecord:
        """How the order stands, for the journal; written whenever that changes."""

    @abstractmethod
    def terms(self, order: AnOrder) -> RequestedTerms:
        """The call by which this order finds its machine."""

    @abstractmethod
    def answer(self, order: AnOrder) -> Message | None:
        """What the counter is told of an order; None for one that did not come in there."""

    def note_price(self, order: AnOrder) -> None:
        """Note what the winner asks for an order."""

    def may_take_back(self, order: AnOrder) -> bool:
        """Whether an order that its winner does not carry out may go to another: it is not begun, by all I know."""
        return not order.is_begun

    def has_begun(self, node: int, order: AnOrder) -> bool:
        """Whether a machine told last that it works on an order: then nobody else can do it."""
        return False

    def may_be_given_back(self, order: AnOrder, why: Reason) -> bool:
        """Whether its winner may give it back by its word alone; ``why`` as that says."""
        return True

    def is_too_late(self, order: AnOrder, now_us: int) -> bool:
        """Whether nobody could carry it out in time any more, whoever is let go."""
        return False

    def stands_us(self, order: AnOrder) -> int:
        """How long its winner may tell no change."""
        return STANDS_AFTER_US

    def in_turn(self) -> Iterable[AnOrder]:
        """The order in which to look after orders; as they came."""
        return self.orders.values()

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """What the heartbeat says: IDLE once every order is over, else WORKING."""
        return MachineState.IDLE if all(one.is_over for one in self.orders.values()) else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """0: a desk has no plan of where to go."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Listen first: orders of an earlier life may be in hand."""
        self._listen_until_us = now_us + LISTEN_US
        for order in self.orders.values():
            order.answer_at_us = now_us
            order.due_us = None if order.is_over else now_us + LISTEN_US
            self._watch(order, now_us)
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Reports about orders of mine, by machines that can carry one out, and who of them is held."""
        if says_held(message):
            self.fleet.negotiation.trust.excuse(message.sender)
        if isinstance(message, ManualState):
            self._is_held(message.sender, now_us, stands=says_held(message) and message.at_rest)
            return self._told.news(self._waiting())
        if self._held and isinstance(message, Heartbeat) and message.state is not MachineState.OBSTACLE:
            # Whoever missed that it was let go hears it go on.
            self._is_held(message.sender, now_us, stands=False)
        if not isinstance(message, TaskReport) or message.task not in self.orders:
            return []
        order = self.orders[message.task]
        machine = self.fleet.site.machines.get(message.sender)
        if machine is None or machine.kind is not self.takers:
            self.fleet.drops[Reason.NOT_OF_KIND] += 1
            return []
        if not order.is_over and self._may_say(order, message.sender, now_us):
            return self._on_report(order, message, now_us)
        # Who has lost it, or never won it, says nothing that counts. It hears so where it claims it: who missed that it
        # was taken back would carry out all the same what its customer was refused.
        is_its = order.state is OrderState.DONE and order.winner == message.sender
        is_claim = message.phase is TaskPhase.AWARDED and not is_its and (order.is_over or not order.named)
        return self.fleet.winners.remind(order.task, message.sender) if is_claim else []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A call is over: somebody has the order, or nobody."""
        order = self.orders.get(event.call.task) if isinstance(event, Closed) else None
        if not isinstance(event, Closed) or order is None:
            return []
        if event.winner:
            return self._goes_to(order, OrderEvent.WON, event.winner, now_us, event.call.call)
        refused = event.result is CallResult.REFUSED
        (self._refused.add if refused else self._refused.discard)(order.task)
        again_us = self._again_us(order, now_us) if refused else 0
        if again_us is None:
            return self.put(order, OrderEvent.HOPELESS, now_us)
        return self.put(order, OrderEvent.NOT_WON, now_us, again_us) + self._told.news(self._waiting())

    def _again_us(self, order: AnOrder, now_us: int) -> int | None:
        """How long until an order that nobody could do is called for again, us; None: it is given up."""
        alive = self.fleet.mirror.alive(now_us)
        if not alive:
            # Cut off from everybody: nobody has refused it.
            order.calls = 0
            return CUT_OFF_US
        if self.is_too_late(order, now_us):
            return None
        if self._held & alive:
            order.calls = 0
            return max(self.call_again_us, HELD_US)
        is_hopeless = self.max_calls is not None and order.calls >= self.max_calls
        return None if is_hopeless else self.call_again_us

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A desk keeps no rights."""
        return Reason.NOT_AUTHORISED

    def advance(self, now_us: int) -> list[Effect]:
        """Call for orders, ask who has one in hand, and answer the counter."""
        effects: list[Effect] = []
        if self._listen_until_us is not None and self._listen_until_us <= now_us:
            self._listen_until_us = None
        for order in self.in_turn():
            effects += self.look_after(order, now_us)
            if self._listen_until_us is None and order.due_us is not None and order.due_us <= now_us:
                effects += self.go_on(order, now_us)
            if order.answer_at_us is not None and order.answer_at_us <= now_us:
                order.answer_at_us = None if order.is_over else now_us + ANSWER_US
                answer = self.answer(order)
                effects += [Tell(answer)] if answer is not None else []
        return effects

    def next_wake(self) -> int | None:
        """When something is to be said or called."""
        times = [self._listen_until_us]
        for order in self.orders.values():
            times.append(order.answer_at_us)
            if self._listen_until_us is None:
                times.append(order.due_us)
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """Nothing: a desk of this kind has neither an itinerary nor cars in its custody."""
        return []

    def _is_held(self, node: int, now_us: int, *, stands: bool) -> None:
        if stands:
            self._held.add(node)
        elif node in self._held:
            self._held.discard(node)
            # What others did not do meanwhile they may do now.
            self.fleet.winners.begin_anew(now_us)

    def _waiting(self) -> Iterator[tuple[str, str]]:
        """Orders that wait for a person to let a machine go: it has them, or nobody else can do them."""
        machines = self.fleet.site.machines
        for order in self.orders.values():
            origin, number = order.task
            name = f"order {number}" if origin == self.fleet.node_id else f"order {number} of node {origin}"
            if order.state is OrderState.IN_HAND and order.winner in self._held:
                yield name, f"{machines[order.winner].name} has it, and is held"
            elif self._held and order.task in self._refused and not order.is_over:
                yield name, "nobody can do it while machines are held"

    # --- orders ------------------------------------------------------------------------------------------------

    def come_in(self, order: AnOrder, now_us: int) -> list[Effect]:
        """A new order: it is journalled before anything follows."""
        self.orders[order.task] = order
        order.answer_at_us = order.due_us = now_us
        self._watch(order, now_us)
        return [Record(self.order_record(order))]

    def take_up(self, order: AnOrder, state: OrderState) -> None:
        """As the journal says that it stood.

        A call does not outlive its desk: it is made again, unless somebody says by its report that it has the order.
        """
        order.may_be_won = state in (OrderState.HEARD, OrderState.CALLED)
        order.state = OrderState.HEARD if state is OrderState.CALLED else state

    def put(self, order: AnOrder, event: OrderEvent, now_us: int, due_in_us: int = 0) -> list[Effect]:
        """What an event does to an order; the counter is told. ``due_in_us``: when it is called for, if it is again."""
        if not order.meet(event):
            return []
        order.answer_at_us = now_us
        match order.state:
            case OrderState.HEARD:
                order.due_us = now_us + due_in_us
            case OrderState.IN_HAND:
                order.due_us = now_us + self.ask_us
            case _:
                order.due_us = None
        if order.is_over:
            self.fleet.winners.over(order.task)
        return [Record(self.state_record(order))]

    def look_after(self, order: AnOrder, now_us: int) -> list[Effect]:
        """An order whose winner is lost is called for anew, without it."""
        if order.state not in (OrderState.CALLED, OrderState.IN_HAND):
            return []
        reason = self.fleet.winners.lost(order.task, now_us)
        if reason is Reason.NONE:
            return []
        if not self.may_take_back(order):
            if reason is not Reason.FALSE_STATEMENT or not self._held:
                # Else it may wait for who is held: for its part of a chain, or as that stands in the way.
                self.fleet.winners.keeps(order.task)
            return []
        # That somebody failed in it says nothing of the others.
        order.calls = 0
        said = self.fleet.winners.take_back(order.task, reason, now_us)
        return said + self.put(order, OrderEvent.TAKEN_BACK, now_us)

    def go_on(self, order: AnOrder, now_us: int) -> list[Effect]:
        """What is due for an order: to be called for, or to be asked after."""
        if order.state is OrderState.HEARD and not self.fleet.mirror.alive(now_us):
            # Nobody acknowledges a frame: calls would wait in the interface, and reach whoever comes minutes too late.
            order.due_us = now_us + ALONE_US
            return []
        if order.state is OrderState.HEARD:
            order.calls += 1
            effects = self.put(order, OrderEvent.CALL, now_us)
            return effects + self.fleet.negotiation.open(self.terms(order), now_us)
        order.due_us = now_us + self.ask_us
        return [Send(SyncRequest(self.fleet.node_id, order.winner))]

    def _may_say(self, order: AnOrder, node: int, now_us: int) -> bool:
        """Whether a word about an order counts: by who has it, is named, or may have won it in my earlier life."""
        if order.named or order.state is OrderState.IN_HAND:
            return node == order.winner
        if self.has_begun(node, order):
            # It was taken back from who was silent; that it had begun was heard only afterwards.
            return True
        return order.may_be_won and self.fleet.winners.may_claim(order.task, node, now_us)

    def _on_report(self, order: AnOrder, report: TaskReport, now_us: int) -> list[Effect]:
        """How an order stands, by who may say it."""
        match report.phase:
            case TaskPhase.REFUSED if order.named:
                return self.put(order, OrderEvent.HOPELESS, now_us)
            case TaskPhase.FORFEITED | TaskPhase.REFUSED:
                is_won = order.state is OrderState.IN_HAND and not order.named
                if not is_won or not self.may_be_given_back(order, report.reason):
                    return []
                self.fleet.winners.over(order.task)
                return self.put(order, OrderEvent.GIVEN_BACK, now_us)
            case TaskPhase.DONE:
                said = self._withdraw(order, now_us)
                if order.state is not OrderState.IN_HAND:
                    order.winner = report.sender
                    self.note_price(order)
                return said + self.put(order, OrderEvent.CARRIED_OUT, now_us)
        if order.state is OrderState.IN_HAND:
            return []
        return self._withdraw(order, now_us) + self._goes_to(order, OrderEvent.CLAIMED, report.sender, now_us)

    def _goes_to(self, order: AnOrder, event: OrderEvent, winner: int, now_us: int, call: int = 0) -> list[Effect]:
        """Somebody has it, by ``call`` where it is known."""
        if (order.state, event) not in NEXT:
            return []
        order.winner, order.may_be_won, order.is_begun = winner, False, False
        self._refused.discard(order.task)
        self.note_price(order)
        effects = self.put(order, event, now_us)
        self._watch(order, now_us, call)
        return effects

    def _withdraw(self, order: AnOrder, now_us: int) -> list[Effect]:
        """Close the call for what somebody has already."""
        if order.state is not OrderState.CALLED:
            return []
        said = self.fleet.negotiation.withdraw(self.terms(order), now_us)
        return [item for item in said if not isinstance(item, NegotiationEvent)]

    def _watch(self, order: AnOrder, now_us: int, call: int = 0) -> None:
        if order.state is OrderState.IN_HAND or (order.named and not order.is_over):
            self.fleet.winners.takes(order.task, order.winner, now_us, call, self.stands_us(order))

"""The goal manager: turns orders at its counter into goals, calls for each, and hears of completion only.

Rows C03, C05 and C18. It names the parts and is their first custodian: a part's token goes to the main contractor of
its goal and to nobody else, and comes back when the part lies where it was wanted.
"""

from dataclasses import dataclass, field
from enum import Enum

from onboard.core.authority import TokenKey, car_token
from onboard.core.behaviour import Fleet, NoEstimator
from onboard.core.codes import NOBODY, CallResult, KindCode, MachineState, Reason, TaskPhase, TokenKind
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.messages import Message, Reference, SyncRequest, TaskReport
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Closed, Estimator, NegotiationEvent
from onboard.core.serial import to_bus_ms
from onboard.core.site import Machine, Site
from onboard.kinds.cell.contracts import Goal
from onboard.kinds.cell.generation import call_terms
from onboard.kinds.cell.geometry import Point
from onboard.kinds.cell.goal_frames import Hearsay
from onboard.kinds.cell.messages import OrderAnswer, OrderFrom, OrderResult, OrderTo, PartAt

#: After power-up the desk listens so long before it calls: who has a goal in hand says so. Ours.
LISTEN_US = 3_000_000
#: The counter is told how an order stands this often, us (dbc/cell.dbc).
ANSWER_US = 2_000_000
#: A main contractor is asked how it stands this often, us. Ours.
ASK_US = 20_000_000
#: A goal that nobody can achieve is refused after so many calls of several attempts each. Ours.
MAX_CALLS = 3


class OrderState(Enum):
    """How an order stands; each is journalled."""

    HEARD = "not called for yet"
    CALLED = "bids may come"
    IN_HAND = "a main contractor has it"
    DONE = "achieved"
    REFUSED = "cannot be achieved"


@dataclass
class Order:
    """One order and its goal. ``contractor`` is the main contractor, 0 for none yet; ``calls`` were made so far."""

    goal: Goal
    state: OrderState = OrderState.HEARD
    contractor: int = NOBODY
    cost: float = 0.0
    calls: int = 0
    answer_at_us: int | None = None
    ask_at_us: int | None = None


class DeskFactory:
    """Makes goal managers."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """Nothing to offer."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "GoalManager":
        """The desk's steps."""
        return GoalManager(fleet)


@dataclass
class GoalManager:
    """One desk. ``orders`` by the goal's name, in the order in which they came."""

    fleet: Fleet
    kind: KindCode = KindCode.DESK
    orders: dict[Reference, Order] = field(default_factory=dict)
    hearsay: Hearsay = field(default_factory=Hearsay)
    _half_told: dict[int, OrderFrom] = field(default_factory=dict)
    _listen_until_us: int | None = None

    def __post_init__(self) -> None:
        for entry in self.fleet.entries:
            self._replay(dict(entry))

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """Heartbeat state."""
        open_ones = (OrderState.HEARD, OrderState.CALLED, OrderState.IN_HAND)
        return MachineState.WORKING if any(o.state in open_ones for o in self.orders.values()) else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """A desk goes nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Listen first: orders of an earlier life may be in hand."""
        self._listen_until_us = now_us + LISTEN_US
        for order in self.orders.values():
            order.answer_at_us = now_us
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Orders at the counter; one that was heard before is only answered."""
        match message:
            case OrderFrom():
                self._half_told[message.order] = message
            case OrderTo():
                return self._on_order(message, now_us)
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Offers, and main contractors' reports."""
        self.hearsay.hear(message)
        if isinstance(message, TaskReport) and message.task in self.orders:
            return self._on_report(message, now_us)
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A call is over: somebody has the goal, or nobody."""
        if not isinstance(event, Closed) or event.call.task not in self.orders:
            return []
        order = self.orders[event.call.task]
        if order.state is not OrderState.CALLED:
            return []
        if event.winner:
            return self._in_hand(order, event.winner, now_us)
        refused = event.result is CallResult.REFUSED and order.calls >= MAX_CALLS
        return self._set(order, OrderState.REFUSED if refused else OrderState.HEARD, now_us)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A part goes to the main contractor of its goal."""
        if key.kind is not TokenKind.CAR:
            return Reason.NOT_AUTHORISED
        part = Reference(key.number >> 16, key.number & 0xFFFF)
        order = next((one for one in self.orders.values() if one.goal.part == part), None)
        mine = order is not None and order.state is OrderState.IN_HAND and order.contractor == requester
        return Reason.NONE if mine else Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        """Call for goals, in the order of their deadlines (row C15); answer the counter; ask contractors."""
        effects: list[Effect] = []
        if self._listen_until_us is not None and self._listen_until_us <= now_us:
            self._listen_until_us = None
        if self._listen_until_us is None:
            waiting = [one for one in self.orders.values() if one.state is OrderState.HEARD]
            for order in sorted(waiting, key=lambda one: one.goal.urgency):
                order.calls += 1
                effects += self._set(order, OrderState.CALLED, now_us)
                effects += self.fleet.negotiation.open(call_terms(order.goal), now_us)
        for order in self.orders.values():
            if order.answer_at_us is not None and order.answer_at_us <= now_us:
                effects += self._answer(order, now_us)
            if order.ask_at_us is not None and order.ask_at_us <= now_us:
                order.ask_at_us = now_us + ASK_US
                effects.append(Send(SyncRequest(self.fleet.node_id, order.contractor)))
        return effects

    def next_wake(self) -> int | None:
        """When something is to be said or called."""
        times = [self._listen_until_us]
        for order in self.orders.values():
            times += [order.answer_at_us, order.ask_at_us]
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """Parts in my custody, and tokens."""
        effects: list[Effect] = []
        for order in self.orders.values():
            if self.fleet.tokens.holds(car_token(*order.goal.part)):
                place = order.goal.end if order.state is OrderState.DONE else order.goal.start
                effects.append(Send(PartAt(self.fleet.node_id, order.goal.part, *place, False)))
        return effects + self.fleet.tokens.statements()

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_order(self, wanted: OrderTo, now_us: int) -> list[Effect]:
        task = Reference(self.fleet.node_id, wanted.order)
        if task in self.orders:
            return self._answer(self.orders[task], now_us)
        begin = self._half_told.pop(wanted.order, None)
        if begin is None:
            # The counter says both again until it is answered.
            return []
        limit_ms = to_bus_ms(now_us + wanted.within_ms * 1000) if wanted.within_ms else 0
        start, end = Point(begin.x_mm, begin.y_mm), Point(wanted.x_mm, wanted.y_mm)
        order = self.orders[task] = Order(Goal(task, task, start, end, (), limit_ms))
        entry: dict[str, str | int] = {"record": "order", "number": task.number, "limit": limit_ms}
        entry |= {"from_x": start.x_mm, "from_y": start.y_mm, "to_x": end.x_mm, "to_y": end.y_mm}
        said = Send(PartAt(self.fleet.node_id, task, *start, False))
        return [Record(entry), *self._answer(order, now_us), said]

    def _on_report(self, report: TaskReport, now_us: int) -> list[Effect]:
        """The main contractor tells that the goal is achieved; all else is between it and its sub-contractors (C18)."""
        order = self.orders[report.task]
        if order.state in (OrderState.DONE, OrderState.REFUSED) or report.phase is TaskPhase.FORFEITED:
            return []
        effects: list[Effect] = []
        if order.state is not OrderState.IN_HAND and report.phase is not TaskPhase.REFUSED:
            # It has won a call that I do not remember, or whose award it has heard sooner than I its word.
            said = self.fleet.negotiation.withdraw(call_terms(order.goal), now_us)
            effects += [item for item in said if not isinstance(item, NegotiationEvent)]
            effects += self._in_hand(order, report.sender, now_us)
        if report.phase is TaskPhase.DONE and report.sender == order.contractor:
            effects += self._set(order, OrderState.DONE, now_us)
        return effects

    def _in_hand(self, order: Order, contractor: int, now_us: int) -> list[Effect]:
        order.contractor = contractor
        offer = self.hearsay.offer(contractor, order.goal.task)
        order.cost = offer.cost if offer is not None else 0.0
        return self._set(order, OrderState.IN_HAND, now_us)

    def _set(self, order: Order, state: OrderState, now_us: int) -> list[Effect]:
        order.state = state
        order.ask_at_us = now_us + ASK_US if state is OrderState.IN_HAND else None
        entry: dict[str, str | int] = {"record": "order_state", "number": order.goal.task.number, "state": state.name}
        entry |= {"contractor": order.contractor, "cost": order.cost.hex()}
        effects: list[Effect] = [Record(entry)]
        return effects + self._answer(order, now_us)

    def _answer(self, order: Order, now_us: int) -> list[Effect]:
        results = {OrderState.IN_HAND: OrderResult.IN_HAND, OrderState.DONE: OrderResult.DONE}
        result = results.get(order.state, OrderResult.RECEIVED)
        if order.state is OrderState.REFUSED:
            result = OrderResult.REFUSED
        is_over = order.state in (OrderState.DONE, OrderState.REFUSED)
        order.answer_at_us = None if is_over else now_us + ANSWER_US
        answer = OrderAnswer(self.fleet.node_id, order.goal.task.number, result, round(1000 * order.cost))
        return [Actuate(answer)]

    def _replay(self, entry: dict[str, str | int]) -> None:
        task = Reference(self.fleet.node_id, int(entry.get("number", 0)))
        if entry.get("record") == "order":
            start = Point(int(entry["from_x"]), int(entry["from_y"]))
            end = Point(int(entry["to_x"]), int(entry["to_y"]))
            self.orders[task] = Order(Goal(task, task, start, end, (), int(entry["limit"])))
        elif entry.get("record") == "order_state":
            order = self.orders[task]
            state = OrderState[str(entry["state"])]
            # A call does not outlive its desk: it is made again, unless somebody says that it has the goal.
            order.state = OrderState.HEARD if state is OrderState.CALLED else state
            order.contractor = int(entry["contractor"])
            order.cost = float.fromhex(str(entry["cost"]))

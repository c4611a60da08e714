"""The order desk of a turning cell: calls for each order, tells the winner's price, and hears of completion."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from onboard.core.authority import TokenKey
from onboard.core.behaviour import Fleet, NoEstimator
from onboard.core.codes import NOBODY, CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.messages import Message, Reference, SyncRequest, TaskReport
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Closed, Estimator, NegotiationEvent
from onboard.core.site import Machine, Site
from onboard.kinds.turning.generation import call_terms
from onboard.kinds.turning.lathe import Job
from onboard.kinds.turning.messages import BillBar, JobAnswer, JobEntry, JobResult

#: After power-up the desk listens so long before it calls: who has an order in hand says so. Ours.
LISTEN_US = 3_000_000
#: The counter is told how an order stands this often, us (dbc/turning.dbc).
ANSWER_US = 2_000_000
#: A lathe is asked how it stands this often, us. Ours.
ASK_US = 60_000_000
#: An order that no lathe can make is refused after so many calls of several attempts each. Ours.
MAX_CALLS = 2


class OrderState(Enum):
    """How an order stands; each is journalled."""

    HEARD = "not called for yet"
    CALLED = "bids may come"
    IN_HAND = "a lathe has it"
    DONE = "made"
    REFUSED = "no lathe can make it"


@dataclass
class Order:
    """One order. ``lathe`` is the winner's node-ID, 0 for none yet; ``total_ct`` the price of one part."""

    task: Reference
    job: Job
    state: OrderState = OrderState.HEARD
    lathe: int = NOBODY
    total_ct: int = 0
    calls: int = 0
    answer_at_us: int | None = None
    ask_at_us: int | None = None


class DeskFactory:
    """Makes order desks."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """Nothing to offer."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "OrderDesk":
        """The desk's steps."""
        return OrderDesk(fleet)


@dataclass
class OrderDesk:
    """One desk. ``orders`` by name, in the order in which they came."""

    fleet: Fleet
    kind: KindCode = KindCode.DESK
    orders: dict[Reference, Order] = field(default_factory=dict)
    _prices: dict[tuple[int, Reference], int] = field(default_factory=dict)
    _listen_until_us: int | None = None

    def __post_init__(self) -> None:
        for entry in self.fleet.entries:
            self._replay(entry)

    @property
    def state(self) -> MachineState:
        """Heartbeat state."""
        over = (OrderState.DONE, OrderState.REFUSED)
        return MachineState.IDLE if all(o.state in over for o in self.orders.values()) else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """A desk goes nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Listen first: orders of an earlier life may be in hand."""
        self._listen_until_us = now_us + LISTEN_US
        for order in self.orders.values():
            order.answer_at_us = now_us
            order.ask_at_us = now_us + LISTEN_US if order.state is OrderState.IN_HAND else None
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Orders at the counter; one that was heard before is only answered."""
        if not isinstance(message, JobEntry):
            return []
        task = Reference(self.fleet.node_id, message.number)
        if task in self.orders:
            return self._answer(self.orders[task], now_us)
        face_mm = message.face_um / 1000
        job = Job(message.drawing, message.material, message.bar_mm, message.batch, face_mm)
        order = self.orders[task] = Order(task, job)
        entry: dict[str, str | int] = {"record": "order", "number": task.number, "drawing": job.drawing}
        entry |= {"material": job.material, "bar_mm": message.bar_mm, "batch": job.batch, "face_um": message.face_um}
        return [Record(entry), *self._answer(order, now_us)]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Prices, and lathes' reports."""
        if isinstance(message, BillBar) and message.manager == self.fleet.node_id:
            self._prices[message.sender, Reference(message.manager, message.task)] = message.total_ct
        if isinstance(message, TaskReport) and message.task in self.orders:
            return self._on_report(message, now_us)
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A call is over: a lathe has the order, or none."""
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
        """A desk holds no tokens."""
        return Reason.NOT_AUTHORISED

    def advance(self, now_us: int) -> list[Effect]:
        """Call for orders, answer the counter, ask lathes."""
        effects: list[Effect] = []
        if self._listen_until_us is not None and self._listen_until_us <= now_us:
            self._listen_until_us = None
        for order in self.orders.values():
            if self._listen_until_us is None and order.state is OrderState.HEARD:
                order.calls += 1
                effects += self._set(order, OrderState.CALLED, now_us)
                effects += self.fleet.negotiation.open(call_terms(order.task, order.job), now_us)
            if order.answer_at_us is not None and order.answer_at_us <= now_us:
                effects += self._answer(order, now_us)
            if order.ask_at_us is not None and order.ask_at_us <= now_us:
                order.ask_at_us = now_us + ASK_US
                effects.append(Send(SyncRequest(self.fleet.node_id, order.lathe)))
        return effects

    def next_wake(self) -> int | None:
        """When something is to be said or called."""
        times = [self._listen_until_us]
        for order in self.orders.values():
            times += [order.answer_at_us, order.ask_at_us]
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """A desk vouches for nothing."""
        return []

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_report(self, report: TaskReport, now_us: int) -> list[Effect]:
        order = self.orders[report.task]
        gone = report.phase in (TaskPhase.FORFEITED, TaskPhase.REFUSED)
        if order.state in (OrderState.DONE, OrderState.REFUSED) or (gone and order.state is not OrderState.IN_HAND):
            return []
        if gone:
            return self._set(order, OrderState.HEARD, now_us) if report.sender == order.lathe else []
        effects: list[Effect] = []
        if order.state is not OrderState.IN_HAND:
            # It has won a call that I do not remember, or whose award it has heard sooner than I its word.
            said = self.fleet.negotiation.withdraw(call_terms(order.task, order.job), now_us)
            effects += [item for item in said if not isinstance(item, NegotiationEvent)]
            effects += self._in_hand(order, report.sender, now_us)
        if report.phase is TaskPhase.DONE and report.sender == order.lathe:
            effects += self._set(order, OrderState.DONE, now_us)
        return effects

    def _in_hand(self, order: Order, lathe: int, now_us: int) -> list[Effect]:
        order.lathe = lathe
        order.total_ct = self._prices.get((lathe, order.task), 0)
        return self._set(order, OrderState.IN_HAND, now_us)

    def _set(self, order: Order, state: OrderState, now_us: int) -> list[Effect]:
        order.state = state
        order.ask_at_us = now_us + ASK_US if state is OrderState.IN_HAND else None
        entry: dict[str, str | int] = {"record": "order_state", "number": order.task.number, "state": state.name}
        entry |= {"lathe": order.lathe, "total_ct": order.total_ct}
        return [Record(entry), *self._answer(order, now_us)]

    def _answer(self, order: Order, now_us: int) -> list[Effect]:
        results = {
            OrderState.IN_HAND: JobResult.IN_HAND,
            OrderState.DONE: JobResult.DONE,
            OrderState.REFUSED: JobResult.REFUSED,
        }
        is_over = order.state in (OrderState.DONE, OrderState.REFUSED)
        order.answer_at_us = None if is_over else now_us + ANSWER_US
        result = results.get(order.state, JobResult.RECEIVED)
        return [Actuate(JobAnswer(self.fleet.node_id, order.task.number, result, order.lathe, order.total_ct))]

    def _replay(self, entry: Mapping[str, str | int]) -> None:
        task = Reference(self.fleet.node_id, int(entry.get("number", 0)))
        if entry.get("record") == "order":
            bar_mm, face_mm = int(entry["bar_mm"]), int(entry["face_um"]) / 1000
            job = Job(int(entry["drawing"]), int(entry["material"]), bar_mm, int(entry["batch"]), face_mm)
            self.orders[task] = Order(task, job)
        elif entry.get("record") == "order_state":
            order = self.orders[task]
            state = OrderState[str(entry["state"])]
            # A call does not outlive its desk: it is made again, unless somebody says that it has the order.
            order.state = OrderState.HEARD if state is OrderState.CALLED else state
            order.lathe, order.total_ct = int(entry["lathe"]), int(entry["total_ct"])

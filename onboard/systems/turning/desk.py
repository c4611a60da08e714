"""The order desk of a turning cell: calls for each order, tells the winner's price, and hears of completion."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet, NoEstimator
from onboard.core.codes import Reason, TaskPhase
from onboard.core.effects import Effect, Record
from onboard.core.messages import Bid, Message, Reference, TaskReport
from onboard.core.mirror import Mirror
from onboard.core.negotiation import CallTerms, Estimator
from onboard.core.negotiation.winners import STANDS_AFTER_US
from onboard.core.site import Machine, Site
from onboard.systems.turning.generation import call_terms, least_cents, longest_us, turning
from onboard.systems.turning.lathe import Job
from onboard.systems.turning.messages import (
    BillBar,
    JobAnswer,
    JobEntry,
    JobResult,
    LathePhase,
    LatheProgress,
)
from onboard.work.counter import Counter, CounterOrder, OrderState


@dataclass
class Order(CounterOrder):
    """An order for a batch of parts; ``total_ct`` is the price of one."""

    job: Job
    total_ct: int = field(default=0, kw_only=True)


@dataclass(frozen=True)
class DeskFactory(BehaviourFactory):
    """Makes order desks."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """Nothing to offer."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "OrderDesk":
        """The desk's steps."""
        return OrderDesk(fleet)


@dataclass
class OrderDesk(Counter[Order]):
    """One desk of a workshop."""

    #: A batch takes long: its lathe is asked how it stands this often, us. Ours.
    ask_us: ClassVar[int] = 60_000_000
    #: An order that no lathe can make is refused after so many calls of several attempts each. Ours.
    max_calls: ClassVar[int] = 2

    _prices: dict[tuple[int, Reference], int] = field(default_factory=dict)
    #: Orders of which their winner has told that it has begun.
    _begun: set[Reference] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.fleet.negotiation.is_sound = self._is_sound

    def _is_sound(self, task: Reference, bid: Bid) -> bool:
        return self._prices.get((bid.sender, task)) == bid.cost

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Orders at the counter; one that was heard before is only answered."""
        if not isinstance(message, JobEntry):
            return []
        task = Reference(self.fleet.node_id, message.number)
        if task in self.orders:
            return self.say(self.orders[task], now_us)
        face_mm = message.face_um / 1000
        job = Job(message.drawing, message.material, message.bar_mm, message.batch, face_mm)
        order = self.orders[task] = Order(task, job)
        entry: dict[str, str | int] = {"record": "order", "number": task.number, "drawing": job.drawing}
        entry |= {"material": job.material, "bar_mm": message.bar_mm, "batch": job.batch, "face_um": message.face_um}
        return [Record(entry), *self.say(order, now_us)]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Prices, and lathes' reports."""
        if isinstance(message, BillBar) and message.manager == self.fleet.node_id:
            self._prices[message.sender, Reference(message.manager, message.task)] = message.total_ct
        elif isinstance(message, LatheProgress):
            self._on_progress(message, now_us)
        return super().hear(message, now_us)

    def _on_progress(self, word: LatheProgress, now_us: int) -> None:
        self.fleet.winners.works(word.sender, (word.manager, word.task, word.made, word.lathe_phase), now_us)
        task = Reference(word.manager, word.task)
        if word.lathe_phase is not LathePhase.QUEUED and self.fleet.winners.has(task, word.sender):
            self._begun.add(task)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A desk holds no tokens."""
        return Reason.NOT_AUTHORISED

    def statements(self, now_us: int) -> list[Effect]:
        """A desk vouches for nothing."""
        return []

    # --- the Counter -------------------------------------------------------------------------------------------

    def terms(self, order: Order) -> CallTerms:
        """A call to lathes; no lathe can make a part for less than its bar and its handling."""
        least_ct = least_cents(turning(self.fleet.site), order.job)
        return replace(call_terms(order.task, order.job), floor=lambda _call, _now_us: least_ct)

    def may_take_back(self, order: Order) -> bool:
        """Not one that is begun: its parts are in the machine, and a second lathe would make them twice."""
        return order.task not in self._begun

    def stands_us(self, order: Order) -> int:
        """As long as the slowest lathe takes for one part, setting up included, tells no change."""
        return STANDS_AFTER_US + longest_us(turning(self.fleet.site), order.job)

    def on_report(self, order: Order, report: TaskReport, now_us: int) -> list[Effect]:
        """A lathe has an order, has made it, or gives it back."""
        if report.phase in (TaskPhase.FORFEITED, TaskPhase.REFUSED):
            gives_back = order.state is OrderState.IN_HAND and report.sender == order.winner
            if not gives_back:
                return []
            self.fleet.winners.over(order.task)
            self._begun.discard(order.task)
            return self.put(order, OrderState.HEARD, now_us)
        effects = self.won_unheard(order, report.sender, now_us) if order.state is not OrderState.IN_HAND else []
        if report.phase is TaskPhase.DONE and report.sender == order.winner:
            effects += self.put(order, OrderState.DONE, now_us)
        return effects

    def price(self, order: Order) -> None:
        """As the winner's bill says."""
        order.total_ct = self._prices.get((order.winner, order.task), 0)

    def price_entry(self, order: Order) -> Mapping[str, str | int]:
        """In cents."""
        return {"total_ct": order.total_ct}

    def noted_price(self, order: Order, entry: Mapping[str, str | int]) -> None:
        """In cents."""
        order.total_ct = int(entry["total_ct"])

    def noted_order(self, entry: Mapping[str, str | int]) -> Order:
        """As ``sense`` noted it."""
        bar_mm, face_mm = int(entry["bar_mm"]), int(entry["face_um"]) / 1000
        job = Job(int(entry["drawing"]), int(entry["material"]), bar_mm, int(entry["batch"]), face_mm)
        return Order(Reference(self.fleet.node_id, int(entry["number"])), job)

    def answer(self, order: Order) -> Message:
        """With the lathe and its price."""
        number, result = order.task.number, JobResult[order.told]
        return JobAnswer(self.fleet.node_id, number, result, order.winner, order.total_ct)

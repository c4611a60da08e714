"""The order desk of a turning cell: calls for each order, tells the winner's price, and hears of completion."""

from dataclasses import dataclass, field, replace
from typing import ClassVar

from onboard.contract.codes import KindCode, OrderResult
from onboard.contract.messages import Bid, Message, Reference
from onboard.contract.turning import BillBar, LathePhase, LatheProgress
from onboard.contract.turning_device import JobAnswer, JobEntry
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect
from onboard.core.journal_records import records_in
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, RequestedTerms
from onboard.core.negotiation.winners import STANDS_AFTER_US
from onboard.core.site import Machine, Site
from onboard.systems.turning.generation import call_terms, least_cents, longest_us, turning
from onboard.systems.turning.lathe import TurningJob
from onboard.systems.turning.records import JobOrderRecord, JobOrderStateRecord
from onboard.work.order_desk import OrderDesk
from onboard.work.order_life import WorkOrder
from onboard.work.plain import NoEstimator


@dataclass
class BatchOrder(WorkOrder):
    """An order for a batch of parts; ``total_ct`` is the price of one."""

    job: TurningJob
    total_ct: int = field(default=0, kw_only=True)


@dataclass(frozen=True)
class BatchDeskFactory(BehaviourFactory):
    """Makes the machine at the counter, which calls for lathes."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """A desk bids for nothing itself."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "JobDesk":
        """A desk with the jobs of its journal."""
        return JobDesk(fleet)


@dataclass
class JobDesk(OrderDesk[BatchOrder]):
    """One desk of a workshop."""

    #: A batch takes long: its lathe is asked how it stands this often, us.
    ask_us: ClassVar[int] = 60_000_000
    #: An order that no lathe can make is refused after so many calls of several attempts each: a machine that is
    #: repaired may answer a later one.
    max_calls: ClassVar[int] = 2
    takers = KindCode.LATHE

    _prices: dict[tuple[int, Reference], int] = field(default_factory=dict)
    #: What each lathe told last to be at work on.
    _making: dict[int, Reference] = field(default_factory=dict)

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
            self.orders[task].answer_at_us = now_us
            return []
        face_mm = message.face_um / 1000
        job = TurningJob(message.drawing, message.material, message.bar_mm, message.batch, face_mm)
        return self.come_in(BatchOrder(task, job), now_us)

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Notes what each lathe asks for a job, ct, and how far those are that were won."""
        if isinstance(message, BillBar) and message.manager == self.fleet.node_id:
            self._prices[message.sender, Reference(message.manager, message.task)] = message.total_ct
        elif isinstance(message, LatheProgress):
            self._on_progress(message, now_us)
        return super().hear(message, now_us)

    def _on_progress(self, word: LatheProgress, now_us: int) -> None:
        self.fleet.winners.works(word.sender, (word.manager, word.task, word.made, word.lathe_phase), now_us)
        task = Reference(word.manager, word.task)
        self._making.pop(word.sender, None)
        if word.lathe_phase in (LathePhase.SETTING_UP, LathePhase.TURNING):
            self._making[word.sender] = task
        if word.lathe_phase is not LathePhase.QUEUED and self.fleet.winners.has(task, word.sender):
            self.orders[task].is_begun = True

    # --- the OrderDesk -----------------------------------------------------------------------------------------

    def terms(self, order: BatchOrder) -> RequestedTerms:
        """A call to lathes; no lathe can make a part for less than its bar and its handling."""
        least_ct = least_cents(turning(self.fleet.site), order.job)
        return replace(call_terms(order.task, order.job), floor=lambda _call, _now_us: least_ct)

    def has_begun(self, node: int, order: BatchOrder) -> bool:
        """By the lathe's last word of its progress."""
        return self._making.get(node) == order.task

    def stands_us(self, order: BatchOrder) -> int:
        """As long as the slowest lathe takes for one part, setting up included, tells no change."""
        return STANDS_AFTER_US + longest_us(turning(self.fleet.site), order.job)

    def note_price(self, order: BatchOrder) -> None:
        """As the winner's bill says."""
        order.total_ct = self._prices.get((order.winner, order.task), 0)

    def state_record(self, order: BatchOrder) -> JobOrderStateRecord:
        """With its price in cents."""
        return JobOrderStateRecord(order.task.number, order.state, order.winner, order.total_ct)

    def order_record(self, order: BatchOrder) -> JobOrderRecord:
        """What is to be made."""
        job = order.job
        face_um = round(job.face_mm * 1000)
        return JobOrderRecord(order.task.number, job.drawing, job.material, round(job.bar_mm), job.batch, face_um)

    def replay(self) -> None:
        """Orders as they came, and how each stands."""
        for record in records_in(self.fleet.entries, JobOrderRecord, JobOrderStateRecord):
            match record:
                case JobOrderRecord():
                    task = Reference(self.fleet.node_id, record.number)
                    self.orders[task] = BatchOrder(task, record.job)
                case JobOrderStateRecord():
                    order = self.orders[Reference(self.fleet.node_id, record.number)]
                    order.winner, order.total_ct = record.winner, record.total_ct
                    self.take_up(order, record.state)

    def answer(self, order: BatchOrder) -> Message:
        """With the lathe and its price."""
        number, result = order.task.number, OrderResult[order.result_name]
        return JobAnswer(self.fleet.node_id, number, result, order.winner, order.total_ct)

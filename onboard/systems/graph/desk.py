"""The order desk: orders for a robot by name go to it, all others are called for (rows G11, G28)."""

from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

from onboard.contract.codes import KindCode, OrderResult, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.graph import RobotAt, RobotMode, VisitList
from onboard.contract.graph_device import VisitAnswer, VisitKey
from onboard.contract.messages import Message, Reference, TaskReport
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.journal_records import records_in
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, RequestedTerms
from onboard.core.site import Machine, Site
from onboard.systems.graph.errands import TRANSPORT_STOPS
from onboard.systems.graph.fields import five, stops_of
from onboard.systems.graph.planning import call_terms, least_finish_ms
from onboard.systems.graph.records import VisitRecord
from onboard.systems.graph.site import FactoryGraph
from onboard.work.order_desk import OrderDesk
from onboard.work.order_life import OrderEvent, OrderState, WorkOrder
from onboard.work.plain import NoEstimator

#: An order by name is said again after this while its robot is not heard, us: an answer needs one frame.
LIST_AGAIN_US = 1_000_000
#: An order for a robot by name is refused, and taken back, where nothing of that robot has changed for so long, us: it
#: may wait for traffic, or for its start.
NAMED_STANDS_US = 600_000_000
#: What an order from outside is told as.
_PHASES = {
    OrderState.HEARD: TaskPhase.OPEN,
    OrderState.CALLED: TaskPhase.OPEN,
    OrderState.IN_HAND: TaskPhase.AWARDED,
    OrderState.DONE: TaskPhase.DONE,
    OrderState.REFUSED: TaskPhase.REFUSED,
}


@dataclass
class Visits(WorkOrder):
    """An order for a robot to visit ``stops``, nodes of the graph, in turn."""

    stops: tuple[int, ...]


@dataclass(frozen=True)
class VisitDeskFactory(BehaviourFactory):
    """Makes the machine at the counter, which calls for robots."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """A desk bids for nothing itself."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "VisitDesk":
        """A desk with the orders of its journal."""
        return VisitDesk(fleet)


@dataclass
class VisitDesk(OrderDesk[Visits]):
    """One desk of a factory graph."""

    takers = KindCode.VEHICLE
    #: A robot that has an order is asked this often how it stands, us: a transport takes minutes.
    ask_us: ClassVar[int] = 20_000_000
    call_again_us: ClassVar[int] = LIST_AGAIN_US

    def replay(self) -> None:
        """All of each order, as it stood last."""
        for record in records_in(self.fleet.entries, VisitRecord):
            task = Reference(record.origin or self.fleet.node_id, record.number)
            order = self.orders[task] = Visits(task, record.stops, winner=record.robot, named=record.named)
            self.take_up(order, record.stage)

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Orders at the counter; one that was heard before is only answered."""
        if not isinstance(message, VisitKey):
            return []
        task = Reference(self.fleet.node_id, message.order)
        if task in self.orders:
            self.orders[task].answer_at_us = now_us
            return []
        order = Visits(task, stops_of(message), winner=message.robot, named=message.robot != NOBODY)
        return self.come_in(order, now_us)

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Robots' reports; orders from outside, which a gateway passes on."""
        if isinstance(message, VisitList) and message.robot == self.fleet.node_id:
            return self._ordered(message, now_us)
        if isinstance(message, RobotAt):
            self._on_robot(message, now_us)
        return super().hear(message, now_us)

    def _on_robot(self, at: RobotAt, now_us: int) -> None:
        self.fleet.winners.works(at.sender, (at.behind, at.node, at.on_edge, at.robot_mode), now_us)
        for order in self.orders.values():
            if order.state is OrderState.IN_HAND and order.winner == at.sender and not order.named:
                order.is_begun |= at.goal == order.stops[-1] or (
                    at.robot_mode is RobotMode.LOADING and at.node == order.stops[0]
                )

    def _ordered(self, message: VisitList, now_us: int) -> list[Effect]:
        """A transport for whichever robot does it best, under the name that its giver has for it; it is answered."""
        task, stops = Reference(message.sender, message.order), stops_of(message)
        order, site = self.orders.get(task), self.fleet.site
        if order is None:
            nodes = site.graph.neighbours if isinstance(site, FactoryGraph) else {}
            if len(stops) != TRANSPORT_STOPS or any(stop not in nodes for stop in stops):
                return [Send(TaskReport(self.fleet.node_id, task, TaskPhase.REFUSED, 0, Reason.IMPOSSIBLE))]
            written = self.come_in(Visits(task, stops), now_us)
            return [*written, Send(TaskReport(self.fleet.node_id, task, TaskPhase.OPEN, 0, Reason.NONE))]
        return [Send(TaskReport(self.fleet.node_id, task, _PHASES[order.state], 0, Reason.NONE))]

    # --- the OrderDesk -----------------------------------------------------------------------------------------

    def terms(self, order: Visits) -> RequestedTerms:
        """A call to robots; none can be there sooner than who stands in the first node."""
        site = self.fleet.site
        assert isinstance(site, FactoryGraph)
        return replace(call_terms(order.task, *order.stops[:2]), floor=partial(least_finish_ms, site))

    def stands_us(self, order: Visits) -> int:
        """A robot that was named may wait for traffic, or for its start."""
        return NAMED_STANDS_US if order.named else super().stands_us(order)

    def look_after(self, order: Visits, now_us: int) -> list[Effect]:
        """One for a robot by name that does not do it is refused, and taken back."""
        if not order.named:
            return super().look_after(order, now_us)
        if not self.fleet.winners.stands(order.task, now_us):
            return []
        taken_back = Send(VisitList(self.fleet.node_id, order.task.number, order.winner, *five(())))
        return [taken_back, *self.put(order, OrderEvent.HOPELESS, now_us)]

    def go_on(self, order: Visits, now_us: int) -> list[Effect]:
        """One for a robot by name is told to it, until it says that it has it."""
        if order.state is OrderState.HEARD and order.named:
            order.due_us = now_us + LIST_AGAIN_US
            return [Send(VisitList(self.fleet.node_id, order.task.number, order.winner, *five(order.stops)))]
        return super().go_on(order, now_us)

    def order_record(self, order: Visits) -> VisitRecord:
        """The whole order: one record tells what was ordered and how far it is."""
        return self.state_record(order)

    def state_record(self, order: Visits) -> VisitRecord:
        """The whole order, with its winner and how far it is."""
        origin, number = order.task
        return VisitRecord(number, order.winner, order.named, order.stops, order.state, origin)

    def answer(self, order: Visits) -> VisitAnswer | None:
        """How it stands, and who has it; nothing at the counter for one that came from outside."""
        if order.task.origin != self.fleet.node_id:
            return None
        return VisitAnswer(self.fleet.node_id, order.task.number, OrderResult[order.result_name], order.winner)

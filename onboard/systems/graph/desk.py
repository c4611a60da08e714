"""The order desk: orders for a robot by name go to it, all others are called for (rows G11, G28)."""

from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial

from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet, NoEstimator
from onboard.core.codes import NOBODY, CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.messages import Message, Reference, SyncRequest, TaskReport
from onboard.core.mirror import Mirror
from onboard.core.negotiation import CallTerms, Closed, Estimator, NegotiationEvent
from onboard.core.negotiation.winners import STANDS_AFTER_US
from onboard.core.site import Machine, Site
from onboard.systems.graph.errands import TRANSPORT_STOPS
from onboard.systems.graph.messages import (
    RobotAt,
    RobotMode,
    VisitAnswer,
    VisitKey,
    VisitList,
    VisitResult,
    five,
    stops_of,
)
from onboard.systems.graph.planning import call_terms, least_finish_ms
from onboard.systems.graph.site import FactoryGraph

#: After power-up the desk listens so long before it calls: who has an order in hand says so, us. Ours.
LISTEN_US = 3_000_000
#: The counter is told how an order stands this often, us (dbc/graph.dbc).
ANSWER_US = 2_000_000
#: An order by name is said again after this while its robot is not heard, us. Ours.
LIST_AGAIN_US = 1_000_000
#: An order for a robot by name is refused, and taken back, where nothing of that robot has changed for so long, us: it
#: may wait for traffic, or for its start. Ours.
NAMED_STANDS_US = 600_000_000
#: A robot that has an order is asked this often how it stands, us. Ours.
ASK_US = 20_000_000


class Stage(Enum):
    """How an order stands; each is journalled."""

    HEARD = "not given to anybody"
    CALLED = "bids may come"
    IN_HAND = "a robot has it"
    DONE = "done"
    REFUSED = "refused"


_RESULTS = {
    Stage.HEARD: VisitResult.RECEIVED,
    Stage.CALLED: VisitResult.RECEIVED,
    Stage.IN_HAND: VisitResult.IN_HAND,
    Stage.DONE: VisitResult.DONE,
    Stage.REFUSED: VisitResult.REFUSED,
}


#: What an order from outside is told as.
_PHASES = {
    Stage.HEARD: TaskPhase.OPEN,
    Stage.CALLED: TaskPhase.OPEN,
    Stage.IN_HAND: TaskPhase.AWARDED,
    Stage.DONE: TaskPhase.DONE,
    Stage.REFUSED: TaskPhase.REFUSED,
}


@dataclass
class DeskOrder:
    """One order: ``robot`` is whom it is for or who has it, 0 for nobody yet; ``named`` where a person named it."""

    task: Reference
    stops: tuple[int, ...]
    robot: int
    named: bool
    stage: Stage = Stage.HEARD
    answer_at_us: int | None = None
    due_us: int | None = None
    #: Whether a call of an earlier life of the desk may have found a winner that the desk has forgotten.
    may_be_won: bool = False
    #: Whether its robot has told that it goes to the second stop already.
    is_begun: bool = False

    def record(self) -> Record:
        """All of it, for the journal."""
        entry: dict[str, str | int] = {"record": "visit", "number": self.task.number, "robot": self.robot}
        entry |= {
            "origin": self.task.origin,
            "named": int(self.named),
            "stops": " ".join(str(one) for one in self.stops),
        }
        return Record(entry | {"stage": self.stage.name})


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
class OrderDesk:
    """One desk; ``orders`` by task, in the order in which they came."""

    fleet: Fleet
    kind: KindCode = KindCode.DESK
    orders: dict[Reference, DeskOrder] = field(default_factory=dict)
    _listen_until_us: int | None = None

    def __post_init__(self) -> None:
        for entry in self.fleet.entries:
            if entry.get("record") == "visit":
                task = Reference(int(entry.get("origin", self.fleet.node_id)), int(entry["number"]))
                stops = tuple(int(one) for one in str(entry["stops"]).split())
                order = DeskOrder(task, stops, int(entry["robot"]), bool(entry["named"]), Stage[str(entry["stage"])])
                # A call of an earlier life may still find a winner: it tells by its report.
                order.may_be_won = order.stage in (Stage.HEARD, Stage.CALLED)
                order.stage = Stage.HEARD if order.stage is Stage.CALLED else order.stage
                self.orders[task] = order

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """Heartbeat state."""
        over = (Stage.DONE, Stage.REFUSED)
        busy = any(order.stage not in over for order in self.orders.values())
        return MachineState.WORKING if busy else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """A desk goes nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Listen first: orders of an earlier life may be in hand."""
        self._listen_until_us = now_us + LISTEN_US
        for order in self.orders.values():
            order.answer_at_us = now_us
            order.due_us = now_us + LISTEN_US
            if order.stage is Stage.IN_HAND or (order.named and order.stage is Stage.HEARD):
                self._watch(order, now_us)
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Orders at the counter; one that was heard before is only answered."""
        if not isinstance(message, VisitKey):
            return []
        task = Reference(self.fleet.node_id, message.order)
        order = self.orders.get(task)
        if order is not None:
            order.answer_at_us = now_us
            return []
        order = self.orders[task] = DeskOrder(task, stops_of(message), message.robot, message.robot != NOBODY)
        order.answer_at_us = order.due_us = now_us
        if order.named:
            self._watch(order, now_us)
        return [order.record()]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Robots' reports; orders from outside, which a gateway passes on."""
        if isinstance(message, VisitList) and message.robot == self.fleet.node_id:
            return self._ordered(message, now_us)
        if isinstance(message, RobotAt):
            self._on_robot(message, now_us)
        if not isinstance(message, TaskReport) or message.task not in self.orders:
            return []
        order = self.orders[message.task]
        machine = self.fleet.site.machines.get(message.sender)
        if machine is None or machine.kind is not KindCode.VEHICLE:
            self.fleet.drops[Reason.NOT_OF_KIND] += 1
            return []
        if order.stage in (Stage.DONE, Stage.REFUSED):
            return []
        if self._may_say(order, message.sender, now_us):
            return self._on_report(order, message, now_us)
        is_claim = message.phase is TaskPhase.AWARDED and not order.named
        return self.fleet.winners.remind(order.task, message.sender) if is_claim else []

    def _on_report(self, order: DeskOrder, report: TaskReport, now_us: int) -> list[Effect]:
        """How an order stands, by who may say it."""
        match report.phase:
            case TaskPhase.AWARDED if order.stage is not Stage.IN_HAND:
                return self._withdraw(order, now_us) + self._in_hand(order, report.sender, now_us)
            case TaskPhase.DONE:
                order.robot = report.sender
                return self._withdraw(order, now_us) + self._set(order, Stage.DONE, now_us, None)
            case TaskPhase.FORFEITED if order.stage is Stage.IN_HAND and not order.named:
                self.fleet.winners.over(order.task)
                return self._set(order, Stage.HEARD, now_us, 0)
            case TaskPhase.REFUSED if order.named:
                return self._set(order, Stage.REFUSED, now_us, None)
        return []

    def _may_say(self, order: DeskOrder, robot: int, now_us: int) -> bool:
        """Whether a robot's word about an order counts: it has it, is named, or may have won it in my earlier life."""
        if order.named or order.stage is Stage.IN_HAND:
            return robot == order.robot
        return order.may_be_won and self.fleet.winners.may_claim(order.task, robot, now_us)

    def _on_robot(self, at: RobotAt, now_us: int) -> None:
        self.fleet.winners.works(at.sender, (at.behind, at.node, at.on_edge, at.robot_mode), now_us)
        for order in self.orders.values():
            if order.stage is Stage.IN_HAND and order.robot == at.sender and not order.named:
                order.is_begun |= at.goal == order.stops[-1] or (
                    at.robot_mode is RobotMode.LOADING and at.node == order.stops[0]
                )

    def _watch(self, order: DeskOrder, now_us: int, call: int = 0) -> None:
        stands_us = NAMED_STANDS_US if order.named else STANDS_AFTER_US
        self.fleet.winners.takes(order.task, order.robot, now_us, call, stands_us)

    def _in_hand(self, order: DeskOrder, robot: int, now_us: int, call: int = 0) -> list[Effect]:
        order.robot, order.may_be_won, order.is_begun = robot, False, False
        self._watch(order, now_us, call)
        return self._set(order, Stage.IN_HAND, now_us, ASK_US)

    def _withdraw(self, order: DeskOrder, now_us: int) -> list[Effect]:
        """Close the call for what somebody has already."""
        if order.stage is not Stage.CALLED:
            return []
        said = self.fleet.negotiation.withdraw(self._terms(order), now_us)
        return [item for item in said if not isinstance(item, NegotiationEvent)]

    def _look_after(self, order: DeskOrder, now_us: int) -> list[Effect]:
        """An order whose robot does not do it goes to another; one for a robot by name is refused, and taken back."""
        if order.named:
            if not self.fleet.winners.stands(order.task, now_us):
                return []
            taken_back = Send(VisitList(self.fleet.node_id, order.task.number, order.robot, *five(())))
            return [taken_back, *self._set(order, Stage.REFUSED, now_us, None)]
        reason = self.fleet.winners.lost(order.task, now_us)
        if reason is not Reason.NONE and order.is_begun:
            self.fleet.winners.keeps(order.task)
        if reason is Reason.NONE or order.is_begun:
            return []
        return self.fleet.winners.take_back(order.task, reason, now_us) + self._set(order, Stage.HEARD, now_us, 0)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """A call is over: somebody has the order, or nobody."""
        order = self.orders.get(event.call.task) if isinstance(event, Closed) else None
        if not isinstance(event, Closed) or order is None or order.stage is not Stage.CALLED:
            return []
        if event.winner:
            return self._in_hand(order, event.winner, now_us, event.call.call)
        if event.result is CallResult.REFUSED:
            return self._set(order, Stage.HEARD, now_us, LIST_AGAIN_US)
        return self._set(order, Stage.HEARD, now_us, 0)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A desk keeps no rights."""
        return Reason.NOT_AUTHORISED

    def advance(self, now_us: int) -> list[Effect]:
        """Give orders to robots, call, ask, and answer the counter."""
        effects: list[Effect] = []
        if self._listen_until_us is not None and self._listen_until_us <= now_us:
            self._listen_until_us = None
        for order in self.orders.values():
            if order.stage not in (Stage.DONE, Stage.REFUSED):
                effects += self._look_after(order, now_us)
            if self._listen_until_us is None and order.due_us is not None and order.due_us <= now_us:
                effects += self._go_on(order, now_us)
            if order.answer_at_us is not None and order.answer_at_us <= now_us:
                over = order.stage in (Stage.DONE, Stage.REFUSED)
                order.answer_at_us = None if over else now_us + ANSWER_US
                if order.task.origin != self.fleet.node_id:
                    # It did not come in at the counter.
                    continue
                result = _RESULTS[order.stage]
                effects.append(Actuate(VisitAnswer(self.fleet.node_id, order.task.number, result, order.robot)))
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
        """No rights, no itinerary."""
        return []

    def _ordered(self, message: VisitList, now_us: int) -> list[Effect]:
        """A transport for whichever robot does it best, under the name that its giver has for it; it is answered."""
        task, stops = Reference(message.sender, message.order), stops_of(message)
        order, site = self.orders.get(task), self.fleet.site
        if order is None:
            nodes = site.graph.neighbours if isinstance(site, FactoryGraph) else {}
            if len(stops) != TRANSPORT_STOPS or any(stop not in nodes for stop in stops):
                return [Send(TaskReport(self.fleet.node_id, task, TaskPhase.REFUSED, 0, Reason.IMPOSSIBLE))]
            order = self.orders[task] = DeskOrder(task, stops, NOBODY, named=False, due_us=now_us)
            return [order.record(), Send(TaskReport(self.fleet.node_id, task, TaskPhase.OPEN, 0, Reason.NONE))]
        return [Send(TaskReport(self.fleet.node_id, task, _PHASES[order.stage], 0, Reason.NONE))]

    # --- steps -------------------------------------------------------------------------------------------------

    def _go_on(self, order: DeskOrder, now_us: int) -> list[Effect]:
        """What is due for an order: to be given, to be called for, or to be asked after."""
        me = self.fleet.node_id
        if order.stage is Stage.HEARD and order.named:
            order.due_us = now_us + LIST_AGAIN_US
            return [Send(VisitList(me, order.task.number, order.robot, *five(order.stops)))]
        if order.stage is Stage.HEARD:
            effects = self._set(order, Stage.CALLED, now_us, None)
            return effects + self.fleet.negotiation.open(self._terms(order), now_us)
        order.due_us = now_us + ASK_US
        return [Send(SyncRequest(me, order.robot))]

    def _terms(self, order: DeskOrder) -> CallTerms:
        """A call to robots; none can be there sooner than who stands in the first node."""
        site = self.fleet.site
        assert isinstance(site, FactoryGraph)
        return replace(call_terms(order.task, *order.stops[:2]), floor=partial(least_finish_ms, site))

    def _set(self, order: DeskOrder, stage: Stage, now_us: int, due_in_us: int | None) -> list[Effect]:
        order.stage = stage
        if stage in (Stage.DONE, Stage.REFUSED):
            self.fleet.winners.over(order.task)
        order.answer_at_us = now_us
        order.due_us = None if due_in_us is None else now_us + due_in_us
        return [order.record()]

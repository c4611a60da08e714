"""The goal manager: turns orders at its counter into goals, calls for each, and hears of completion only.

Rows C03, C05 and C18. It names the parts and is their first custodian: a part's token goes to the main contractor of
its goal and to nobody else, and comes back when the part lies where it was wanted.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import ClassVar

from onboard.contract.cell import ArmProgress, GoalTooDeep, PartAt, RefusedFor
from onboard.contract.cell_device import OrderAnswer, OrderFrom, OrderTo
from onboard.contract.codes import KindCode, OrderResult, Reason, TokenKind
from onboard.contract.messages import CallForProposals, Message, Reference
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.journal_records import records_in
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, RequestedTerms
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Machine, Site
from onboard.systems.cell.contracts import Goal, part_token
from onboard.systems.cell.fields import MAX_PATH
from onboard.systems.cell.generation import call_terms
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.goal_frames import GoalsHeard
from onboard.systems.cell.records import GoalOrderRecord, GoalStateRecord
from onboard.work.order_desk import OrderDesk
from onboard.work.order_life import OrderEvent, OrderState, WorkOrder
from onboard.work.plain import NoEstimator


@dataclass
class GoalOrder(WorkOrder):
    """An order and its goal; the winner is its main contractor."""

    goal: Goal
    cost: float = field(default=0.0, kw_only=True)
    #: Whether a robot has said that the chain of robots would be too long.
    is_too_deep: bool = field(default=False, kw_only=True)
    #: The version of the part's token with which it came back from who never took the part up; 0: it did not.
    untouched: int = field(default=0, kw_only=True)
    #: When it was last called for, bus us.
    called_us: int = field(default=0, kw_only=True)


@dataclass(frozen=True)
class GoalManagerFactory(BehaviourFactory):
    """Makes the machine at the counter, which calls for arms."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """A desk bids for nothing itself."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "GoalManager":
        """A desk with the goals of its journal."""
        return GoalManager(fleet)


@dataclass
class GoalManager(OrderDesk[GoalOrder]):
    """One desk of a cell."""

    #: A main contractor is asked how it stands this often, us: a lost last word costs this long and no more.
    ask_us: ClassVar[int] = 20_000_000
    #: A goal that nobody can achieve is refused after so many calls of several attempts each: a machine that is
    #: repaired may answer a later one.
    max_calls: ClassVar[int] = 3
    takers = KindCode.ARM

    goals_heard: GoalsHeard = field(default_factory=GoalsHeard)
    _half_told: dict[int, OrderFrom] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.fleet.negotiation.is_sound = self.goals_heard.is_sound

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
        self.goals_heard.hear(message)
        if isinstance(message, CallForProposals):
            # Who looks for somebody for the rest of a goal does all that it can.
            self.fleet.winners.works(message.sender, message.call, now_us)
        if isinstance(message, ArmProgress):
            self.fleet.winners.works(message.sender, (message.x_mm, message.y_mm, message.arm_phase), now_us)
        if isinstance(message, GoalTooDeep):
            self._on_too_deep(message, now_us)
        return super().hear(message, now_us)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A part goes to the main contractor of its goal."""
        if key.kind is not TokenKind.CAR:
            return Reason.NOT_AUTHORISED
        part = Reference(key.number >> 16, key.number & 0xFFFF)
        order = next((one for one in self.orders.values() if one.goal.part == part), None)
        mine = order is not None and order.state is OrderState.IN_HAND and order.winner == requester
        return Reason.NONE if mine else Reason.TOKEN_NOT_GRANTABLE_YET

    def statements(self, now_us: int) -> list[Effect]:
        """Parts in my custody, and tokens."""
        effects: list[Effect] = []
        for order in self.orders.values():
            if self.fleet.tokens.holds(part_token(order.goal.part)):
                place = order.goal.end if order.state is OrderState.DONE else order.goal.start
                effects.append(Send(PartAt(self.fleet.node_id, order.goal.part, place.x_mm, False, place.y_mm)))
        return effects + self.fleet.tokens.statements()

    def _on_too_deep(self, word: GoalTooDeep, now_us: int) -> None:
        """A shorter chain may be found yet, until the time for bids is over."""
        order = next((one for one in self.orders.values() if one.goal.part == word.part), None)
        machine = self.fleet.site.machines.get(word.sender)
        if order is None or order.state is not OrderState.CALLED or machine is None or machine.kind is not self.takers:
            return
        if not order.is_too_deep:
            order.is_too_deep, order.due_us = True, order.called_us + self.fleet.site.timing.call_window_us

    def go_on(self, order: GoalOrder, now_us: int) -> list[Effect]:
        """What is due while bids may come needs a longer chain: called for one level deeper, or refused."""
        if order.state is not OrderState.CALLED:
            order.called_us, order.is_too_deep = now_us, False
            return super().go_on(order, now_us)
        order.due_us = None
        if any(one.best is not None for one in self.fleet.negotiation.initiators if one.terms.task == order.task):
            order.is_too_deep = False
            return []
        withdrawn = self._withdraw(order, now_us)
        if order.goal.deepest == MAX_PATH:
            return withdrawn + self.put(order, OrderEvent.HOPELESS, now_us)
        order.goal, order.calls = replace(order.goal, deepest=order.goal.deepest + 1), 0
        return withdrawn + self.put(order, OrderEvent.NOT_WON, now_us)

    def _on_order(self, wanted: OrderTo, now_us: int) -> list[Effect]:
        task = Reference(self.fleet.node_id, wanted.order)
        if task in self.orders:
            self.orders[task].answer_at_us = now_us
            return []
        begin = self._half_told.pop(wanted.order, None)
        if begin is None:
            # The counter says both again until it is answered.
            return []
        limit_ms = to_bus_ms(now_us + wanted.within_ms * 1000) if wanted.within_ms else 0
        start, end = Point(begin.x_mm, begin.y_mm), Point(wanted.x_mm, wanted.y_mm)
        order = GoalOrder(task, Goal(task, task, start, end, (), limit_ms))
        return [*self.come_in(order, now_us), Send(PartAt(self.fleet.node_id, task, start.x_mm, False, start.y_mm))]

    # --- the OrderDesk -----------------------------------------------------------------------------------------

    def terms(self, order: GoalOrder) -> RequestedTerms:
        """The call to arms: whoever brings the part there at least cost."""
        return call_terms(order.goal)

    def may_take_back(self, order: GoalOrder) -> bool:
        """While the part has never left my custody, or came back untouched; else it lies where it was wanted."""
        key, tokens = part_token(order.goal.part), self.fleet.tokens
        return tokens.holds(key) and (key not in tokens.given or tokens.own_version(key) == order.untouched)

    def may_be_given_back(self, order: GoalOrder, why: Reason) -> bool:
        """As it may be taken back: what is between the main contractor and its sub-contractors is theirs (C18).

        A contractor that a person holds gives back the part that it has not begun to take, and says so.
        """
        key, tokens = part_token(order.goal.part), self.fleet.tokens
        if why is Reason.OPERATOR and tokens.holds(key):
            order.untouched = tokens.own_version(key)
        return self.may_take_back(order)

    def is_too_late(self, order: GoalOrder, now_us: int) -> bool:
        """After its time limit (row C14)."""
        limit_ms = order.goal.time_limit_ms
        return limit_ms != 0 and now_us > from_bus_ms(limit_ms, now_us)

    def in_turn(self) -> Iterable[GoalOrder]:
        """In the order of their deadlines (row C15)."""
        return sorted(self.orders.values(), key=lambda one: one.goal.urgency)

    def note_price(self, order: GoalOrder) -> None:
        """As the main contractor offered."""
        offer = self.goals_heard.offer(order.winner, order.goal.task)
        order.cost = offer.cost if offer is not None else 0.0

    def state_record(self, order: GoalOrder) -> GoalStateRecord:
        """How far the goal is, with the cost in m that its contract has."""
        return GoalStateRecord(order.task.number, order.state, order.winner, order.cost, order.is_too_deep)

    def order_record(self, order: GoalOrder) -> GoalOrderRecord:
        """Where a part is wanted."""
        goal = order.goal
        return GoalOrderRecord(order.task.number, goal.time_limit_ms, *goal.start, *goal.end)

    def replay(self) -> None:
        """Orders as they came, and how each stands."""
        for record in records_in(self.fleet.entries, GoalOrderRecord, GoalStateRecord):
            match record:
                case GoalOrderRecord():
                    task = Reference(self.fleet.node_id, record.number)
                    start, end = Point(record.from_x, record.from_y), Point(record.to_x, record.to_y)
                    self.orders[task] = GoalOrder(task, Goal(task, task, start, end, (), record.limit))
                case GoalStateRecord():
                    order = self.orders[Reference(self.fleet.node_id, record.number)]
                    order.winner, order.cost, order.is_too_deep = record.winner, record.cost, record.is_too_deep
                    self.take_up(order, record.state)

    def answer(self, order: GoalOrder) -> Message:
        """The end of the order for the counter, with its cost in mm."""
        number, result = order.task.number, OrderResult[order.result_name]
        why = RefusedFor.NOTHING
        if result is OrderResult.REFUSED:
            why = RefusedFor.TOO_DEEP if order.is_too_deep else RefusedFor.NOBODY
        return OrderAnswer(self.fleet.node_id, number, result, round(1000 * order.cost), why)

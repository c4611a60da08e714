"""Orders from outside: taken once each, said on the bus until heard, and their life told back. No I/O, no clock.

An order is journalled before it is said, so after a restart it is the same order, and the same name again is the same
order still. Nothing here gives a right: what follows on the bus is a customer's press or a list of nodes, and the
machines negotiate as ever.
"""

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from onboard.contract.codes import TaskPhase
from onboard.contract.messages import Message, Reference, TaskReport
from onboard.core.journal_records import records_in
from onboard.core.serial import is_newer, successor
from onboard.core.site import Site
from onboard.gateway.bus_orders import LISTEN_US, BusOrders, RefusedError, is_robot
from onboard.gateway.inbox import Incoming
from onboard.gateway.moments import announced_us, moment_us
from onboard.gateway.order import RANK, GatewayOrder, OrderRequest, order_of, same_content, with_number
from onboard.gateway.records import OrderPhase, WishRecord
from onboard.gateway.roles import Roles
from onboard.gateway.schema import TRANSPORT
from onboard.history.history import Fact
from onboard.history.tasks import TaskTold
from onboard.ports.journal import Entry

#: Orders that are over are remembered, the newest so many, so that their names are known when they come again.
KEPT = 2_000
#: Open orders at most; one more is refused.
MOST_OPEN = 200
#: Lists of stops of one order that wait for the one in hand; one update more is refused.
MOST_AHEAD = 16
_PHASES = {
    TaskPhase.OPEN: OrderPhase.CALLED,
    TaskPhase.AWARDED: OrderPhase.AWARDED,
    TaskPhase.STARTED: OrderPhase.MOVING,
    TaskPhase.LOADED: OrderPhase.MOVING,
    TaskPhase.DONE: OrderPhase.DONE,
    TaskPhase.REFUSED: OrderPhase.REFUSED,
    TaskPhase.FORFEITED: OrderPhase.CALLED,
}


@dataclass
class OrderEffects:
    """What follows from a step: ``changed`` orders are durable before ``say`` goes to the bus and anything is told.

    ``to_tell`` are orders to be told of that did not change; ``refused`` what was not taken.
    """

    changed: list[GatewayOrder] = field(default_factory=list)
    say: list[Message] = field(default_factory=list)
    to_tell: list[GatewayOrder] = field(default_factory=list)
    refused: list[Incoming] = field(default_factory=list)


class OrderBook:
    """All orders of a site that came in through one gateway, by name, oldest first."""

    def __init__(
        self,
        site: Site,
        bus_orders: BusOrders,
        node_id: int,
        entries: Iterable[Entry],
        roles: Roles | None = None,
        *,
        now_us: int = 0,
        seed: int = 0,
    ) -> None:
        """``seed`` (16 bits) begins the numbers of visit lists where the journal is empty: another than last time."""
        self.book: OrderedDict[str, GatewayOrder] = OrderedDict()
        self._site, self._bus_orders, self._node_id, self._roles = site, bus_orders, node_id, roles or {}
        self._number = seed & 0xFFFF
        self._asked = False
        self._ready_us = now_us + LISTEN_US
        numbers: list[int] = []
        for record in records_in(entries, WishRecord):
            order = order_of(record)
            self.book.pop(order.name, None)
            self.book[order.name] = order
            numbers += [order.request.number] if order.request.number else []
        for place, number in enumerate(numbers):
            # The newest by serial arithmetic, for an older order may have been written about last.
            self._number = number if not place or is_newer(number, self._number, 16) else self._number
        for order in self.open:
            # A key is not pressed again: what it led to is heard, or was.
            heard = order.request.what == "park" and order.life is not OrderPhase.ACCEPTED
            order.due_us = None if heard or _waits(order) else self._ready_us

    @property
    def open(self) -> list[GatewayOrder]:
        """Orders that are not over."""
        return [order for order in self.book.values() if not order.life.is_over]

    def entries(self) -> Iterator[Entry]:
        """What counts of all, for the journal."""
        return (order.entry() for order in self.book.values())

    def of_robot(self, node: int) -> GatewayOrder | None:
        """The order that a robot has by name, the newest; None where it never had one."""
        newest = reversed(self.book.values())
        return next((one for one in newest if one.request.what == "visit" and one.request.node == node), None)

    # --- in ------------------------------------------------------------------------------------------------------

    def take(self, incoming: Incoming, wall_us: int, now_us: int) -> OrderEffects:
        """A transport, or a VDA 5050 order, that is well formed."""
        outcome = OrderEffects()
        try:
            self._take(incoming, wall_us, now_us, outcome)
        except RefusedError as refused:
            outcome.refused.append(replace(incoming, reason=refused.reason, path=refused.path, why=refused.why))
        return outcome

    def _take(self, incoming: Incoming, wall_us: int, now_us: int, outcome: OrderEffects) -> None:
        body = incoming.body
        name, update = name_of(incoming), int(body.get("orderUpdateId", 0))
        # What one giver has named is not another's to ask after; orders without a giver are as they were.
        content = same_content(incoming.kind, _essence(body), *([incoming.giver] if incoming.giver else []))
        known = self.book.get(name)
        if known is not None:
            if known.update != update:
                self._update(known, body, content, outcome)
                return
            if known.content != content:
                raise RefusedError("NAME_TAKEN", "another order has this name", _NAME[incoming.kind])
            outcome.to_tell.append(known)
            return
        if update and incoming.kind != TRANSPORT:
            raise RefusedError("NO_ORDER", "an update of an order that is not known", "$.orderUpdateId")
        if len(self.open) >= MOST_OPEN:
            raise RefusedError("TOO_MANY", f"{MOST_OPEN} orders are open")
        is_due = incoming.kind == TRANSPORT and "before" in body
        before_us = moment_us(body["before"], "$.before") if is_due else None
        if before_us is not None and before_us <= wall_us:
            raise RefusedError("TOO_LATE", "is past", "$.before")
        request = self._request(incoming, wall_us)
        order = GatewayOrder(name, request, content, before_us, update, giver=incoming.giver)
        order.due_us = max(now_us, self._ready_us)
        self.book[name] = order
        outcome.changed.append(order)
        self._forget()

    def _update(self, order: GatewayOrder, body: dict[str, Any], content: int, outcome: OrderEffects) -> None:
        """More of an order by name: what its update releases is done behind what was released (section 6.6.4)."""
        if body["orderUpdateId"] < order.update:
            raise RefusedError("OLD_UPDATE", f"update {order.update} was taken before", "$.orderUpdateId")
        if order.life.is_over or order.is_cancelled:
            raise RefusedError("ORDER_OVER", "the order is over; give a new one", "$.orderId")
        request = self._bus_orders.visit(order.request.node, body, order.request.base)
        if len(order.ahead) >= MOST_AHEAD:
            raise RefusedError("TOO_MANY", f"{MOST_AHEAD} updates wait", "$.orderUpdateId")
        order.update, order.content = body["orderUpdateId"], content
        order.ahead += (request.stops,) if request.stops else ()
        order.request = replace(order.request, base=request.base, is_open=request.is_open)
        if _waits(order):
            self._next(order)
        outcome.changed.append(order)

    def _next(self, order: GatewayOrder) -> None:
        """The robot has done what it was given: it gets the next list, waits for an update, or the order is done."""
        if order.ahead and not order.is_cancelled:
            self._number = successor(self._number, 16)
            order.request = replace(order.request, stops=order.ahead[0], number=self._number)
            order.ahead = order.ahead[1:]
            order.life, order.was_said, order.due_us = OrderPhase.CALLED, False, 0
        elif order.request.is_open and not order.is_cancelled:
            order.request, order.due_us = replace(order.request, stops=()), None
        else:
            self._end(order, OrderPhase.DONE, "", "")

    def _request(self, incoming: Incoming, wall_us: int) -> OrderRequest:
        if incoming.kind == TRANSPORT:
            request = self._bus_orders.transport(incoming.body)
            if "fetch_at" in incoming.body:
                fetch_us = announced_us(incoming.body["fetch_at"], self._site, wall_us)
                request = replace(request, fetch_us=fetch_us)
            self._bus_orders.check_role(request, self._roles.get(incoming.giver))
            return self._numbered(request)
        node = next((one.node_id for one in self._site.machines.values() if one.name == incoming.serial), 0)
        if not is_robot(self._site, node):
            raise RefusedError("UNKNOWN_MACHINE", "no machine of this name travels", "$.serialNumber")
        request = self._bus_orders.visit(node, incoming.body)
        busy = self.of_robot(node)
        if busy is not None and not busy.life.is_over:
            raise RefusedError("BUSY", f"{incoming.serial} has order {busy.name}", "$.orderId")
        return self._numbered(request)

    def _numbered(self, request: OrderRequest) -> OrderRequest:
        """A name on the bus, for what is told under one of this gateway's."""
        if request.what not in ("visit", "send"):
            return request
        self._number = successor(self._number, 16)
        return with_number(request, self._number)

    def cancel(self, node: int) -> OrderEffects | None:
        """End a robot's order by name; None where it has none. A robot that has it is told until it says so."""
        order = self.of_robot(node)
        if order is None or order.life.is_over:
            return None
        if order.was_said and not _waits(order):
            order.is_cancelled, order.due_us = True, 0
            return OrderEffects(changed=[order])
        return OrderEffects(changed=[self._end(order, OrderPhase.REFUSED, "CANCELLED", "before it was given")])

    # --- the bus and the clock -----------------------------------------------------------------------------------

    def feed(self, fact: Fact | None) -> OrderEffects:
        """Take up what one message of the fleet bus has told."""
        outcome = OrderEffects()
        for order in self.open:
            task = (
                self._bus_orders.task_of(order, fact)
                if order.life in (OrderPhase.ACCEPTED, OrderPhase.CALLED)
                else None
            )
            if task is not None and (task != order.task or order.life is OrderPhase.ACCEPTED):
                order.task, order.life, order.due_us = task, OrderPhase.CALLED, None
                outcome.changed.append(order)
            elif isinstance(fact, TaskTold) and fact.report.task == self._task(order):
                self._on_report(order, fact.report, outcome)
            elif self._bus_orders.is_done(order, fact):
                outcome.changed.append(self._end(order, OrderPhase.DONE, "", ""))
        return outcome

    def _on_report(self, order: GatewayOrder, report: TaskReport, outcome: OrderEffects) -> None:
        life = _PHASES.get(report.phase)
        by_robot = is_robot(self._site, report.sender)
        by_desk = report.sender == order.request.node and order.request.what == "send"
        if life is None or (not by_robot and not by_desk and life is not OrderPhase.REFUSED):
            return
        if life is OrderPhase.DONE and order.request.what == "visit":
            order.owner = report.sender
            if not _waits(order):
                self._next(order)
                outcome.changed.append(order)
        elif life.is_over:
            reason = report.reason.name if life is OrderPhase.REFUSED else ""
            order.owner = report.sender if by_robot else order.owner
            outcome.changed.append(self._end(order, life, reason, ""))
        elif report.phase is TaskPhase.FORFEITED or RANK[life] > RANK[order.life]:
            order.task, order.life, order.due_us = report.task, life, 0 if order.is_cancelled else None
            order.owner = report.sender if by_robot and life is not OrderPhase.CALLED else 0
            outcome.changed.append(order)

    def wake(self, now_us: int, wall_us: int) -> OrderEffects:
        """Say what is due; ``wall_us`` is the same moment since 1970."""
        outcome = OrderEffects()
        if not self._asked:
            self._asked = True
            outcome.say += self._bus_orders.ask_all(self._node_id)
        for order in self.open:
            if order.due_us is not None and order.due_us <= now_us:
                self._say(order, now_us, wall_us, outcome)
        return outcome

    def next_wake(self) -> int | None:
        """When something is due; None for never."""
        return min((order.due_us for order in self.open if order.due_us is not None), default=None)

    def _say(self, order: GatewayOrder, now_us: int, wall_us: int, outcome: OrderEffects) -> None:
        try:
            to_say = self._bus_orders.say(order, self._node_id, wall_us)
        except RefusedError as refused:
            gone = order.was_said and refused.reason == "UNKNOWN_TICKET"
            # Asked for before, and not in the park any more: somebody has it.
            life = OrderPhase.DONE if gone else OrderPhase.REFUSED
            outcome.changed.append(self._end(order, life, "" if gone else refused.reason, "" if gone else refused.why))
            return
        if not order.was_said:
            order.was_said = True
            outcome.changed.append(order)
        outcome.say += to_say.messages
        order.due_us = None if to_say.again_us is None else now_us + to_say.again_us

    # --- inner works -------------------------------------------------------------------------------------------

    def _task(self, order: GatewayOrder) -> Reference | None:
        """The task on the bus: heard, or named by the order itself."""
        return Reference(self._node_id, order.request.number) if order.request.number else order.task

    def _end(self, order: GatewayOrder, life: OrderPhase, reason: str, why: str) -> GatewayOrder:
        order.life, order.reason, order.why, order.due_us = life, reason, why, None
        return order

    def _forget(self) -> None:
        over = [name for name, order in self.book.items() if order.life.is_over]
        for name in over[: max(0, len(over) - KEPT)]:
            del self.book[name]


def _waits(order: GatewayOrder) -> bool:
    """Whether a robot has done all that was released of its order, and waits for more."""
    return order.request.what == "visit" and not order.request.stops


_NAME = {TRANSPORT: "$.id", "order": "$.orderId"}


def name_of(incoming: Incoming) -> str:
    """An order's name; a robot's orders are apart from the fleet's. Empty where it has none."""
    if incoming.kind == TRANSPORT:
        return str(incoming.body.get("id", ""))
    return f"{incoming.serial}/{incoming.body.get('orderId', '')}"


def _essence(body: dict[str, Any]) -> list[tuple[str, Any]]:
    """What an order says, without what differs when it is sent again."""
    return sorted((key, repr(value)) for key, value in body.items() if key not in ("headerId", "timestamp"))

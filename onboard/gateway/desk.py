"""Where orders meet the bus: judged, taken, journalled, said, told back. The one place of the gateway that speaks."""

from collections import deque
from collections.abc import Callable, Iterable

from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.gateway.actions import InstantActions
from onboard.gateway.dialect import Json, timestamp
from onboard.gateway.edge import edge_of
from onboard.gateway.factsheet import MOST_ID
from onboard.gateway.inbox import Inbox, Incoming
from onboard.gateway.order import GatewayOrder
from onboard.gateway.orders import OrderBook, OrderEffects, name_of
from onboard.gateway.pauses import MODES, Closed, Pauses
from onboard.gateway.publisher import FLEET, Outgoing, Publisher
from onboard.gateway.records import OrderPhase
from onboard.gateway.reports import Reports
from onboard.gateway.settings import level
from onboard.gateway.state import Subject
from onboard.history.calls import CallOpened, CallRepeated
from onboard.history.hands import HandTold
from onboard.history.history import Fact
from onboard.history.loads import LoadTold
from onboard.history.system import SystemFact
from onboard.history.tasks import TaskTold
from onboard.ports.broker import Publication

#: Orders that wait to be judged, and as many instant actions, which go before them: a pause waits behind no flood. Of
#: more the newest is counted and stays with the broker until the next session.
MOST_WAITING = 64
#: Errors of refused orders that a machine's state tells, the newest so many.
MOST_ERRORS = 4
#: What a refusal is called in a machine's state (VDA 5050 2.1, section 6.6.4); all others are an `orderError`.
_ERRORS = {
    "MALFORMED": "validationError",
    **dict.fromkeys(("OLD_UPDATE", "NOT_CONTINUED", "ORDER_OVER", "NO_ORDER"), "orderUpdateError"),
}
#: What an order's life tells of its task.
_OF_TASK = ("task", "car", "promised", "ready", "spread_s", "ready_from", "ready_to")
_HEARD = (CallOpened, CallRepeated, LoadTold, TaskTold, SystemFact)


class GatewayDesk:
    """Takes orders for a site. ``post`` queues what is told, ``send`` puts a message on the bus."""

    def __init__(
        self,
        site: Site,
        publisher: Publisher,
        reports: Reports,
        send: Callable[[Message], None],
        post: Callable[[Iterable[Outgoing]], None],
        now_us: int,
    ) -> None:
        self.overflows = 0
        self._site, self._publisher, self._reports, self._send, self._post = site, publisher, reports, send, post
        settings, fleet = publisher.settings, publisher.fleet
        assert settings.node_id is not None, "who only listens takes no orders"
        self.inbox = Inbox(settings.dialect, publisher.root, settings.manufacturer, settings.roles)
        bus_orders = edge_of(site).bus_orders(fleet.picture.view, fleet.place)
        seed = (settings.epoch_us + now_us) // 1_000_000
        self.orders = OrderBook(
            site, bus_orders, settings.node_id, reports.others, settings.roles, now_us=now_us, seed=seed
        )
        reports.keep = self.orders.entries
        self.pauses = Pauses(settings.node_id, seed)
        self._no_pause = bus_orders.no_pause
        #: Actions that take a robot's order back, until it says so.
        self._cancelling: dict[int, list[Json]] = {}
        self._waiting: deque[tuple[Publication, Callable[[], None]]] = deque()
        self._waiting_actions: deque[tuple[Publication, Callable[[], None]]] = deque()
        self._actions = {machine.name: InstantActions() for machine in site.machines.values()}
        self._errors: dict[int, deque[Json]] = {}

    def on_publication(self, publication: Publication, taken: Callable[[], None]) -> None:
        """One publication on a topic subscribed to; ``taken`` is called once what comes of it is on disk."""
        waiting = self._waiting_actions if self.inbox.is_action(publication.topic) else self._waiting
        if len(waiting) >= MOST_WAITING:
            self.overflows += 1
            return
        waiting.append((publication, taken))

    def next_wake(self) -> int | None:
        """When something is due, us; None for never. What waits is due at once."""
        if self._waiting or self._waiting_actions:
            return 0
        times = (self.orders.next_wake(), *self.pauses.due())
        return min((time for time in times if time is not None), default=None)

    async def work(self, now_us: int) -> None:
        """Judge what waits and say what is due."""
        while waiting := self._waiting_actions or self._waiting:
            publication, taken = waiting.popleft()
            await self._judge(publication, now_us)
            # Only now: had the power failed before, the broker would bring it again.
            taken()
        await self._perform(self.orders.wake(now_us, self._publisher.settings.epoch_us + now_us), now_us)
        due, closed = self.pauses.wake(now_us)
        for message in due:
            self._send(message)
        self._close(closed, now_us)

    async def feed(self, fact: Fact | None, now_us: int) -> None:
        """Take up what one message of the fleet bus has told."""
        if isinstance(fact, HandTold):
            self._close(self.pauses.feed(fact.word, now_us), now_us)
        if isinstance(fact, _HEARD) and self.orders.open:
            await self._perform(self.orders.feed(fact), now_us)

    # --- in ------------------------------------------------------------------------------------------------------

    async def _judge(self, publication: Publication, now_us: int) -> None:
        incoming = self.inbox.judge(publication, now_us)
        if incoming is None:
            return
        if incoming.reason:
            self._refuse(incoming, now_us)
        elif incoming.kind == "instantActions":
            await self._act(incoming, now_us)
        else:
            outcome = self.orders.take(incoming, self._publisher.settings.epoch_us + now_us, now_us)
            self.inbox.refused.update(one.reason for one in outcome.refused)
            await self._perform(outcome, now_us)

    async def _act(self, incoming: Incoming, now_us: int) -> None:
        known = self._actions.get(incoming.serial)
        if known is None:
            self._refuse(self.inbox.refuse(incoming, "UNKNOWN_MACHINE", "no machine of this name travels"), now_us)
            return
        node = self._site.machine(incoming.serial).node_id
        for action in incoming.body["actions"]:
            if known.is_known(action):
                continue
            kind = action["actionType"]
            if kind in MODES and not self._no_pause:
                known.begin(action)
                self._close(self.pauses.ask(node, action, now_us), now_us)
                continue
            if kind == "cancelOrder":
                known.begin(action)
                await self._cancel(node, action, now_us)
                continue
            failure = await self._act_once(node, kind, now_us)
            known.close(self._publisher.settings.dialect, action, failure)
        self._tell_machine(node, now_us)
        self._post(self._publisher.tell_now(node, now_us))

    async def _cancel(self, node: int, action: Json, now_us: int) -> None:
        outcome = self.orders.cancel(node)
        if outcome is None:
            self._close([(node, action, "there is no order")], now_us)
            return
        self._cancelling.setdefault(node, []).append(action)
        await self._perform(outcome, now_us)

    def _close(self, closed: list[Closed], now_us: int) -> None:
        """Instant actions that took their time are over."""
        for node, action, failure in closed:
            self._actions[self._site.machines[node].name].close(self._publisher.settings.dialect, action, failure)
            self._tell_machine(node, now_us)

    async def _act_once(self, node: int, kind: str, now_us: int) -> str:
        """Why it failed; empty where it was done."""
        if kind == "factsheetRequest":
            self._post(self._publisher.tell_factsheet(node, now_us))
        elif kind != "stateRequest":
            return self._no_pause if kind in MODES else "not supported"
        return ""

    # --- out -----------------------------------------------------------------------------------------------------

    async def _perform(self, outcome: OrderEffects, now_us: int) -> None:
        """First the journal, then the bus, then whoever asked."""
        for order in outcome.changed:
            try:
                await self._reports.append(order.entry())
            except OSError:
                if order.life is OrderPhase.ACCEPTED and not order.was_said:
                    del self.orders.book[order.name]
                    outcome.refused.append(Incoming("", "", {"id": order.name}, "NOT_DURABLE", "$", "the disk is full"))
                    continue
            if order.life is not OrderPhase.ACCEPTED or not order.was_said:
                self._tell(order, now_us)
            if order.life.is_over:
                failure = "" if order.reason == "CANCELLED" else f"the order was {order.life.value} before"
                over = self._cancelling.pop(order.request.node, []) if order.request.what == "visit" else []
                self._close([(order.request.node, action, failure) for action in over], now_us)
        for message in outcome.say:
            self._send(message)
        for order in outcome.to_tell:
            self._post([Outgoing(FLEET, self._answer(order, now_us))])
        for incoming in outcome.refused:
            self._refuse(incoming, now_us)

    def _tell(self, order: GatewayOrder, now_us: int) -> None:
        answer = self._answer(order, now_us)
        name = f"order {order.name} {order.life.value}" if order.life.is_over else ""
        self._post([Outgoing(FLEET, answer, name)])
        if order.request.what == "visit":
            self._tell_machine(order.request.node, now_us)

    def _answer(self, order: GatewayOrder, now_us: int) -> Publication:
        body: Json = {"at": self._publisher.at(now_us), "id": order.name, "phase": order.life.value}
        if order.task is not None:
            stands = self._publisher.fleet.task(order.task, now_us)
            body |= {key: stands[key] for key in _OF_TASK if key in stands}
        if order.giver:
            body["orderedBy"] = order.giver
        if order.owner:
            body["owner"] = self._publisher.fleet.picture.view.name(order.owner)
        if order.before_us is not None:
            body["before"] = timestamp(order.before_us)
            body["late"] = (
                max(body.get("promised", ""), body["at"] if order.life is OrderPhase.DONE else "") > body["before"]
            )
        body |= {key: one for key, one in (("reason", order.reason), ("why", order.why)) if one}
        return self._publisher.publication(f"order/{level(order.name)}", body, qos=1)

    def _refuse(self, incoming: Incoming, now_us: int) -> None:
        name = name_of(incoming)[: 2 * MOST_ID]
        body = {
            "at": self._publisher.at(now_us),
            "id": name,
            "phase": OrderPhase.REFUSED.value,
            "reason": incoming.reason,
        }
        body |= {"path": incoming.path, "why": incoming.why}
        body |= {"orderedBy": incoming.giver} if incoming.giver else {}
        self._post([Outgoing(FLEET, self._publisher.publication(f"order/{level(name)}", body, qos=1))])
        node = next((one.node_id for one in self._site.machines.values() if one.name == incoming.serial), None)
        if node is not None:
            references = [{"referenceKey": "path", "referenceValue": incoming.path}]
            references.append(
                {"referenceKey": "orderId", "referenceValue": str(incoming.body.get("orderId", ""))[:MOST_ID]}
            )
            kind = _ERRORS.get(incoming.reason, "orderError")
            error = {"errorType": kind, "errorLevel": "WARNING", "errorReferences": references}
            error |= {"errorDescription": f"{incoming.reason}: {incoming.path}: {incoming.why}"}
            self._errors.setdefault(node, deque(maxlen=MOST_ERRORS)).append(error)
            self._tell_machine(node, now_us)

    def _tell_machine(self, node: int, now_us: int) -> None:
        """What its state tells of orders; an order that was taken clears the errors of those that were not."""
        order = self.orders.of_robot(node)
        errors = self._errors.get(node)
        if order is not None and errors and order.life is OrderPhase.ACCEPTED:
            errors.clear()
        actions = self._actions[self._site.machines[node].name]
        name = order.name.partition("/")[2] if order is not None else None
        self._publisher.subjects[node] = Subject(
            order_id=name,
            update_id=order.update if order is not None else None,
            errors=tuple(errors or ()),
            actions=tuple(actions.states.values()),
        )
        self._publisher.wants(node, now_us)

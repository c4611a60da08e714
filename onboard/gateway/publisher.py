"""What is published when: a value that eats messages of the fleet bus and answers with publications. No I/O, no clock.

One link a machine, so that each has a last will of its own, and one for the fleet (docs/mqtt.md). VDA 5050 asks for a
state at every change and at least every 30 s; changes that come close together are told together.
"""

import json
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from onboard.contract.codes import TaskPhase
from onboard.contract.messages import Message, TaskReport
from onboard.core.site import Site
from onboard.gateway import state as vda
from onboard.gateway.dialect import Connection, Json, timestamp
from onboard.gateway.factsheet import factsheet
from onboard.gateway.fleet import WHOLE, FleetTopics
from onboard.gateway.machines import Machines
from onboard.gateway.settings import GatewaySettings, level
from onboard.history.history import Fact
from onboard.history.tasks import TaskTold
from onboard.ports.broker import Publication

#: The link of the fleet's own topics.
FLEET = ""
_TERMINAL = (TaskPhase.DONE, TaskPhase.REFUSED)
#: What may differ between two states that tell the same: where in between two nodes a machine is.
_PASSING = ("agvPosition", "mobileRobotPosition", "velocity", "distanceSinceLastNode")


@dataclass(frozen=True, slots=True)
class Outgoing:
    """One publication of a link. ``report`` names a terminal report, which must not be lost; empty for telemetry."""

    link: str
    publication: Publication
    report: str = ""


@dataclass
class _Due:
    """What of one machine is told next, us; and what was told last."""

    state_us: int
    told_us: int | None = None
    essence: Json = field(default_factory=dict)
    seen_us: int | None = None
    connection: Connection | None = None


class Publisher:
    """Feed it the fleet bus in order; call ``wake`` at ``next_wake``."""

    def __init__(self, site: Site, settings: GatewaySettings, now_us: int = 0) -> None:
        self.site = site
        self.settings = settings
        self.fleet = FleetTopics(site, settings)
        self.history = self.fleet.picture.history
        self.machines = Machines(site, self.history)
        #: What is known of a machine's order from outside the bus, by node-ID.
        self.subjects: dict[int, vda.Subject] = {}
        self._headers: Counter[tuple[int, str]] = Counter()
        self._told_of = [node for node, one in self.machines.bodies.items() if settings.tells_of(one.machine.name)]
        self._due = {node: _Due(now_us + settings.state_us) for node in self._told_of}
        self._fixed: dict[str, Json] = {}
        self._indicators_us = now_us + settings.indicators_us
        self.root = f"{settings.prefix}/{level(site.name)}"

    @property
    def links(self) -> tuple[str, ...]:
        """All links: the fleet's, where the whole site is told of, and one a mobile machine."""
        machines = tuple(self._serial(node) for node in self._told_of)
        return machines if self.settings.serials else (FLEET, *machines)

    def set_epoch(self, epoch_us: int) -> None:
        """Wall time in us since 1970 at loop time 0, where the clock was set."""
        self.settings = replace(self.settings, epoch_us=epoch_us)
        self.fleet.set_epoch(epoch_us)

    # --- what a link says of itself ------------------------------------------------------------------------------

    def will(self, link: str, now_us: int) -> Publication:
        """What the broker says once the link is gone without a word."""
        return self._link_state(link, Connection.BROKEN, now_us)

    def hello(self, link: str, now_us: int) -> list[Publication]:
        """What a link says first: how it is connected, and what never changes."""
        if link == FLEET:
            fixed = [self.publication(topic, body, retain=True) for topic, body in self._fixed.items()]
            return [self._link_state(link, Connection.ONLINE, now_us), *fixed]
        node = self._node(link)
        connection = self._connection_of(node, now_us)
        self._due[node].connection = connection
        found = [self._link_state(link, connection, now_us), self._factsheet(node, now_us)]
        return [*found, self._state(node, now_us)] if connection is not Connection.OFFLINE else found

    def goodbye(self, link: str, now_us: int) -> Publication:
        """What a link says last where it ends in order."""
        return self._link_state(link, Connection.OFFLINE, now_us)

    # --- the bus ---------------------------------------------------------------------------------------------------

    def feed(self, message: Message, now_us: int) -> list[Outgoing]:
        """Take up one message of the fleet bus."""
        return self.take(message, self.history.feed(message, now_us), now_us)

    def take(self, message: Message, fact: Fact | None, now_us: int) -> list[Outgoing]:
        """Take up one message that the history was fed with, and what it made of it."""
        return list(self._take(message, fact, now_us))

    def wake(self, now_us: int) -> list[Outgoing]:
        """All publications that are due at loop time ``now_us``."""
        return list(self._wake(now_us))

    def next_wake(self) -> int:
        """When something is due, us."""
        times = [self._indicators_us]
        for node, due in self._due.items():
            times.append(due.state_us)
            if due.connection is Connection.ONLINE:
                times.append(self.machines.silent_us(node))
        return min(times)

    def tell_now(self, node: int, now_us: int) -> list[Outgoing]:
        """A state at once, whatever was told before."""
        if node not in self._due:
            return []
        self._due[node].essence = {}
        return list(self._tell_state(node, self._due[node], now_us))

    def tell_factsheet(self, node: int, now_us: int) -> list[Outgoing]:
        """Publish one machine's factsheet again; nothing for a machine that does not travel."""
        if node not in self._due:
            return []
        return [Outgoing(self._serial(node), self._factsheet(node, now_us))]

    def wants(self, node: int, now_us: int) -> None:
        """Something about a machine's order has changed that the bus does not tell."""
        if node in self._due:
            self._due[node].state_us = min(self._due[node].state_us, now_us)

    # --- inner works -------------------------------------------------------------------------------------------

    def _take(self, message: Message, fact: Fact | None, now_us: int) -> Iterator[Outgoing]:
        self.machines.take(message, fact, now_us)
        body = self._of_fleet(message, fact, now_us)
        if not self.settings.serials:
            yield from body
        else:
            deque(body, maxlen=0)
        node = message.sender
        if node in self._due and self._due[node].connection is not Connection.ONLINE:
            yield from self._connections([node], now_us)
        for node in sorted(self.machines.changed & self._due.keys()):
            due = self._due[node]
            soonest_us = now_us if due.told_us is None else due.told_us + self.settings.least_state_us
            due.state_us = min(due.state_us, max(now_us, soonest_us))
        self.machines.changed.clear()
        for node in sorted(self.machines.moved & self._due.keys()):
            yield from self._moved(node, now_us)
        self.machines.moved.clear()

    def _wake(self, now_us: int) -> Iterator[Outgoing]:
        yield from self._connections(self._told_of, now_us)
        for node, due in self._due.items():
            if due.state_us <= now_us:
                yield from self._tell_state(node, due, now_us)
        if self._indicators_us <= now_us:
            self._indicators_us = now_us + self.settings.indicators_us
            if not self.settings.serials:
                body = self.fleet.indicators(now_us)
                yield Outgoing(FLEET, self.publication("indicators", body, retain=True))

    def _of_fleet(self, message: Message, fact: Fact | None, now_us: int) -> Iterator[Outgoing]:
        for topic, body in self.fleet.take(message, fact, now_us):
            retain = topic.startswith("machine/")
            if retain and self._fixed.get(topic) == body:
                continue
            if retain:
                self._fixed[topic] = body
            yield Outgoing(FLEET, self.publication(topic, body, retain=retain))
        if isinstance(fact, TaskTold) and fact.report.phase in _TERMINAL:
            yield from self._report(fact.report, now_us)

    def _report(self, report: TaskReport, now_us: int) -> Iterator[Outgoing]:
        """The end of a task, under a name by which who keeps reports tells that the bus says it twice."""
        operation = self.fleet.operation_of(report.task)
        known = operation in WHOLE or (operation is None and report.sender in self.machines.bodies)
        if not known:
            return
        body = self.fleet.task(report.task, now_us)
        name = f"{vda.reference_text(report.task)}-{report.phase.name.lower()}"
        body |= {"id": f"{body['at'][:10]}-{name}", "phase": report.phase.name.lower()}
        body |= {"by": self.fleet.picture.view.name(report.sender), "reason": report.reason.name}
        yield Outgoing(FLEET, self.publication("report", body, qos=1), name)

    def _moved(self, node: int, now_us: int) -> Iterator[Outgoing]:
        due, where = self._due[node], self.machines.where(node)
        if where.map_id is None or (due.seen_us is not None and now_us - due.seen_us < self.settings.visualization_us):
            return
        due.seen_us = now_us
        body = vda.visualization(self.settings.dialect, where, self._headers[node, "state"])
        yield Outgoing(self._serial(node), self._vda(node, "visualization", body, now_us))

    def _tell_state(self, node: int, due: _Due, now_us: int) -> Iterator[Outgoing]:
        content = self._content(node, now_us)
        essence = {key: value for key, value in content.items() if key not in _PASSING}
        late = due.told_us is None or now_us - due.told_us >= self.settings.state_us
        if not late and essence == due.essence:
            assert due.told_us is not None
            due.state_us = due.told_us + self.settings.state_us
            return
        due.essence, due.told_us, due.state_us = essence, now_us, now_us + self.settings.state_us
        yield Outgoing(self._serial(node), self._vda(node, "state", content, now_us))

    def _factsheet(self, node: int, now_us: int) -> Publication:
        sheet = factsheet(self.settings.dialect, self.site, self.site.machines[node], self.settings)
        return self._vda(node, "factsheet", sheet, now_us, retain=True)

    def _state(self, node: int, now_us: int) -> Publication:
        return self._vda(node, "state", self._content(node, now_us), now_us)

    def _content(self, node: int, now_us: int) -> Json:
        task = self.machines.bodies[node].task
        does = self.fleet.operation_of(task.task) if task is not None else None
        subject = self.subjects.get(node, vda.Subject())
        return vda.state(self.settings.dialect, self.machines, node, now_us, subject, does)

    def _connections(self, nodes: Iterable[int], now_us: int) -> Iterator[Outgoing]:
        for node in nodes:
            connection, due = self._connection_of(node, now_us), self._due[node]
            if connection is not due.connection:
                due.connection = connection
                due.state_us = min(due.state_us, now_us)
                yield Outgoing(self._serial(node), self._link_state(self._serial(node), connection, now_us))

    def _connection_of(self, node: int, now_us: int) -> Connection:
        if not self.machines.bodies[node].is_heard:
            return Connection.OFFLINE
        return Connection.BROKEN if self.machines.is_silent(node, now_us) else Connection.ONLINE

    def _link_state(self, link: str, connection: Connection, now_us: int) -> Publication:
        if link == FLEET:
            return self.publication("status", {"state": connection.value}, qos=1, retain=True)
        body = vda.connection(self.settings.dialect, connection)
        return self._vda(self._node(link), "connection", body, now_us, qos=1, retain=True)

    def at(self, time_us: int) -> str:
        """A time of the loop as a time stamp."""
        return timestamp(self.settings.epoch_us + time_us)

    def publication(self, topic: str, body: Json, *, qos: int = 0, retain: bool = False) -> Publication:
        """One message of the fleet's own topics; ``topic`` below PREFIX/SITE."""
        return Publication(f"{self.root}/{topic}", _bytes(body), qos, retain)

    def _vda(self, node: int, name: str, body: Json, now_us: int, *, qos: int = 0, retain: bool = False) -> Publication:
        dialect, maker, serial = self.settings.dialect, self.settings.manufacturer, self._serial(node)
        header = dialect.header(self._headers[node, name], self.settings.epoch_us + now_us, maker, serial)
        self._headers[node, name] += 1
        return Publication(dialect.topic(maker, serial, name), _bytes(header | body), qos, retain)

    def _serial(self, node: int) -> str:
        return level(self.site.machines[node].name)

    def _node(self, link: str) -> int:
        return next(node for node in self._told_of if self._serial(node) == link)


def _bytes(body: Json) -> bytes:
    return json.dumps(body, separators=(",", ":")).encode()

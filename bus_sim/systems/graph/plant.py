"""A factory graph: robots' bodies, the order desks' counters, and the oracle.

It knows nothing of agents, signals or tokens; it moves what it is ordered to move and notes what must never happen:
two bodies on one edge (row G08), a body that leaves the graph or turns back (rows G03, G09), a full node.
"""

from dataclasses import dataclass
from functools import partial

from bus_sim.devices.link import BusDeviceLink, DeviceBusLink
from bus_sim.devices.timers import Timers
from bus_sim.systems.graph.body import GraphRobotBody
from onboard.contract.codes import OrderResult
from onboard.contract.graph import BodyPlace
from onboard.contract.graph_device import VisitAnswer, VisitKey
from onboard.contract.messages import Message
from onboard.systems.graph.fields import five
from onboard.systems.graph.site import FactoryGraph, Rules, VisitOrder, edge

#: Orders begin so long after power-up, us: the machines find each other first.
ORIGIN_US = 10_000_000
REPEAT_US = 1_000_000
#: A robot counts its loading by its own clock, which may run so much too fast, per cent: the most that a campaign's
#: clocks drift. By a clock that is set, or jumps, it begins anew.
FAST_PERCENT = 10


@dataclass
class VisitEntry:
    """One order at a counter and what became of it."""

    number: int
    order: VisitOrder
    begun_us: int
    result: OrderResult | None = None
    robot: int = 0
    ended_us: int | None = None


class VisitCounter:
    """A desk's counter: says each order until it is answered."""

    def __init__(self, node_id: int, plant: "GraphPlant", link: DeviceBusLink) -> None:
        self.entries: list[VisitEntry] = []
        self._node_id = node_id
        self._plant = plant
        self._link = link
        link.subscribe(self._on_message)

    def add(self, order: VisitOrder) -> None:
        """Somebody orders visits at this moment; said to the desk, and again until it answers."""
        entry = VisitEntry(len(self.entries) + 1, order, self._plant.timers.now_us())
        self.entries.append(entry)
        self._say(entry)

    def _say(self, entry: VisitEntry) -> None:
        if entry.result is None:
            order = entry.order
            self._link.send(VisitKey(self._node_id, entry.number, order.robot, *five(order.stops)))
            self._plant.timers.call_at(self._plant.timers.now_us() + REPEAT_US, lambda: self._say(entry))

    def _on_message(self, message: Message, _: int) -> None:
        if not isinstance(message, VisitAnswer) or not 0 < message.order <= len(self.entries):
            return
        entry = self.entries[message.order - 1]
        if entry.ended_us is not None:
            return
        entry.result, entry.robot = message.visit_result, message.robot
        if message.visit_result in (OrderResult.DONE, OrderResult.REFUSED):
            entry.ended_us = self._plant.timers.now_us()
            self._plant.check_end(entry)


class GraphPlant:
    """All bodies and counters, and the oracle's notes in ``violations``."""

    def __init__(self, site: FactoryGraph, timers: Timers, links: dict[int, BusDeviceLink]) -> None:
        self.site = site
        self.timers = timers
        self.links = links
        self.violations: list[str] = []
        self.bodies = {node: GraphRobotBody(machine, self, links[node]) for node, machine in site.robots.items()}
        self.counters = {node: VisitCounter(node, self, links[node]) for node in site.desks}
        self._to_come = len(site.orders)

    def start(self) -> None:
        """Power on, and let the orders come."""
        for body in self.bodies.values():
            body.start()
        desks = list(self.counters.values())
        for number, order in enumerate(self.site.orders):
            come = partial(self._come, desks[number % len(desks)], order)
            self.timers.call_at(ORIGIN_US + order.at_ms * 1000, come)

    def _come(self, counter: VisitCounter, order: VisitOrder) -> None:
        self._to_come -= 1
        counter.add(order)

    @property
    def entries(self) -> list[VisitEntry]:
        """All orders that came so far, counter by counter."""
        return [entry for counter in self.counters.values() for entry in counter.entries]

    @property
    def is_over(self) -> bool:
        """Whether all orders have come and each is done or refused, and every robot stands in a node (row G07)."""
        done = not self._to_come and all(entry.ended_us is not None for entry in self.entries)
        return done and all(body.place is BodyPlace.IN_NODE for body in self.bodies.values())

    def holds(self, body: GraphRobotBody) -> bool:
        """Whether a body is kept before its approach sensor for now; by itself the plant keeps nobody.

        How fast robots drive is nobody's promise: a plant that plays a timing of its own slows them here.
        """
        return False

    # --- the oracle --------------------------------------------------------------------------------------------

    def note(self, violation: str) -> None:
        """Something that must never happen has happened."""
        self.violations.append(f"{self.timers.now_us() / 1e6:.3f} s: {violation}")

    def check_onto(self, body: GraphRobotBody, start: int, end: int) -> None:
        """One robot an edge, on edges of the graph only, and nobody turns back on the way."""
        name = body.machine.name
        if end not in self.site.graph.neighbours[start]:
            self.note(f"{name} leaves the graph between {start} and {end}")
        others = [one.machine.name for one in self.bodies.values() if one is not body and one.edge == edge(start, end)]
        if others:
            self.note(f"{name} meets {', '.join(others)} between {start} and {end}")
        if body.place is not BodyPlace.IN_NODE and end == body.behind:
            self.note(f"{name} turns back at {start}")

    def check_into(self, body: GraphRobotBody) -> None:
        """A node has so many slots, where the rules count them."""
        inside = [one for one in self.bodies.values() if one.place is BodyPlace.IN_NODE and one.node == body.node]
        if self.site.rules is Rules.EDGE_AND_NODE and len(inside) > self.site.capacity:
            self.note(f"{len(inside)} robots in node {body.node}, which has {self.site.capacity} slots")

    def check_end(self, entry: VisitEntry) -> None:
        """What was told to be done was done: the robot stood in each node in turn for its loading."""
        if entry.result is not OrderResult.DONE:
            return
        body = self.bodies.get(entry.robot)
        stays = [] if body is None else [*body.stays, (body.node, body.since_us, self.timers.now_us())]
        left, loads_us = list(entry.order.stops), self.site.load_ms * (1000 - 10 * FAST_PERCENT)
        for node, from_us, to_us in stays:
            if left and node == left[0] and to_us - max(from_us, entry.begun_us) >= loads_us:
                left.pop(0)
        if left:
            self.note(f"order {entry.number} was told done, and nobody loaded in node {left[0]}")
        if entry.order.robot not in (0, entry.robot):
            self.note(f"order {entry.number} was for node-ID {entry.order.robot}, and {entry.robot} did it")


def make_plant(site: FactoryGraph, timers: Timers, links: dict[int, BusDeviceLink], seed: int) -> GraphPlant:
    """The plant of a graph; nothing in it is drawn by chance."""
    return GraphPlant(site, timers, links)

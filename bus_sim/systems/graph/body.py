"""Drive, body and sensors of one robot: along an edge at constant speed, on to the next or into the node ahead."""

from typing import Protocol

from bus_sim.devices.link import DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from onboard.contract.graph import BodyPlace, RouteAction
from onboard.contract.graph_device import ApproachSensor, BodyState, RouteOrder
from onboard.contract.messages import Message
from onboard.core.site import Machine
from onboard.systems.graph.fields import NO_NODE
from onboard.systems.graph.site import FactoryGraph, edge

#: A moving drive that hears no order for this long stops (dbc/graph.dbc).
DRIVE_TIME_OUT_US = 500_000
WORD_US = 10_000_000


class Hall(Protocol):
    """What a body asks of the plant that it drives in (``GraphPlant``)."""

    site: FactoryGraph
    timers: Timers

    def holds(self, body: "GraphRobotBody") -> bool:
        """Whether it is kept before its approach sensor for now."""

    def check_onto(self, body: "GraphRobotBody", start: int, end: int) -> None:
        """It drives onto an edge."""

    def check_into(self, body: "GraphRobotBody") -> None:
        """It has come into a node."""


class GraphRobotBody:
    """One robot's body. ``offset_mm`` counts from the beginning of its edge, as of when it began to move last."""

    def __init__(self, machine: Machine, plant: Hall, link: DeviceBusLink) -> None:
        self.machine = machine
        self.node = machine.home.track
        self.behind = NO_NODE
        self.place = BodyPlace.IN_NODE
        #: When it came into the node where it stands; every stay so far as (node, from, to).
        self.since_us = 0
        self.stays: list[tuple[int, int, int]] = []
        self._plant = plant
        self._timers = plant.timers
        self._link = link
        #: Whether the plant keeps it before the approach sensor (``Hall.holds``).
        self.is_held = False
        self._offset_mm = 0.0
        self._began_us: int | None = None
        self._sequence = 0
        self._order: RouteOrder | None = None
        self._fresh_until_us = 0
        self._pending: list[Timer] = []
        self._expiry: Timer | None = None
        self._word: Timer | None = None
        link.subscribe(self._on_message)
        link.answer(self._say)

    def start(self) -> None:
        """Power on: say where it is."""
        self._say()

    @property
    def edge(self) -> tuple[int, int] | None:
        """The edge it is on, None in a node."""
        return None if self.place is BodyPlace.IN_NODE else edge(self.behind, self.node)

    @property
    def length_mm(self) -> int:
        """Length of the edge it is on."""
        return self._plant.site.graph.length_mm(self.behind, self.node)

    def offset_mm(self, now_us: int) -> float:
        """How far along its edge it is."""
        if self._began_us is None:
            return self._offset_mm
        moved = (now_us - self._began_us) * self._plant.site.speed_mm_s / 1e6
        return min(self._offset_mm + moved, float(self.length_mm))

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_message(self, message: Message, _: int) -> None:
        if not isinstance(message, RouteOrder):
            return
        now_us = self._timers.now_us()
        self._fresh_until_us = now_us + DRIVE_TIME_OUT_US
        self._order = message
        self._sequence = message.sequence
        if self._began_us is None and not self.is_held:
            self._begin(message, now_us)
        self._watch()

    def _begin(self, order: RouteOrder, now_us: int) -> None:
        """Start from rest, where the order fits to where the body is."""
        if self.place is BodyPlace.IN_NODE:
            if order.route_action is RouteAction.GO and order.start == self.node:
                self._onto(order.end, now_us)
                self._say()
            return
        own = (order.start, order.end) == (self.behind, self.node)
        if (own and self.place is BodyPlace.ON_EDGE) or order.start == self.node:
            self._move(now_us)

    def _onto(self, end: int, now_us: int) -> None:
        """From the node, or past it, onto the next edge."""
        if self.place is BodyPlace.IN_NODE:
            self.stays.append((self.node, self.since_us, now_us))
        self._plant.check_onto(self, self.node, end)
        if end not in self._plant.site.graph.neighbours[self.node]:
            # There is nothing to drive on: the oracle has noted the order, and the body stays.
            return
        self.behind, self.node, self.place = self.node, end, BodyPlace.ON_EDGE
        self._offset_mm = 0.0
        self._move(now_us)

    def _move(self, now_us: int) -> None:
        for timer in self._pending:
            timer.cancel()
        self._began_us = now_us
        site = self._plant.site
        to_end_mm = self.length_mm - self._offset_mm
        to_sensor_mm = to_end_mm - site.approach_mm
        self._pending = [self._timers.call_at(now_us + round(to_end_mm * 1e6 / site.speed_mm_s), self._at_end)]
        if to_sensor_mm > 0:
            when_us = now_us + round(to_sensor_mm * 1e6 / site.speed_mm_s)
            self._pending.append(self._timers.call_at(when_us, self._at_sensor))

    def _at_sensor(self) -> None:
        if self._plant.holds(self):
            self._halt_here()
            return
        self._link.send(ApproachSensor(self.machine.node_id, self.behind, self.node))

    def go_on(self) -> None:
        """The plant holds it no longer: past the sensor, if it was held there."""
        if self.is_held:
            self.is_held = False
            self._link.send(ApproachSensor(self.machine.node_id, self.behind, self.node))
            self._move(self._timers.now_us())
            self._watch()

    def _halt_here(self) -> None:
        self.is_held = True
        self._offset_mm, self._began_us = float(self.length_mm - self._plant.site.approach_mm), None
        for timer in self._pending:
            timer.cancel()

    def _at_end(self) -> None:
        """At the end of the edge: on, or into the node, or wait at the line."""
        now_us, order = self._timers.now_us(), self._order
        self._offset_mm, self._began_us = float(self.length_mm), None
        if order is not None and order.start == self.node and order.route_action is RouteAction.GO:
            self._onto(order.end, now_us)
        elif order is not None and order.start == self.node:
            self.place, self.since_us = BodyPlace.IN_NODE, now_us
            self._plant.check_into(self)
        else:
            self.place = BodyPlace.AT_LINE
        self._say()
        self._watch()

    def _watch(self) -> None:
        """Stop where no fresh order comes."""
        if self._expiry is not None:
            self._expiry.cancel()
        moving = self._began_us is not None
        self._expiry = self._timers.call_at(self._fresh_until_us, self._expire) if moving else None

    def _expire(self) -> None:
        now_us = self._timers.now_us()
        if self._began_us is None or now_us < self._fresh_until_us:
            return
        self._offset_mm, self._began_us, self._order = self.offset_mm(now_us), None, None
        for timer in self._pending:
            timer.cancel()
        self._say()

    def _say(self) -> None:
        self._link.send(BodyState(self.machine.node_id, self._sequence, self.behind, self.node, self.place))
        if self._word is not None:
            self._word.cancel()
        self._word = self._timers.call_at(self._timers.now_us() + WORD_US, self._say)

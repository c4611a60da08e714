"""From the end of a frame to the receivers' handlers: who hears it, in which order, and what faults do to that.

Delivery is where a bus model spends its time, so the way from a sender's identifier to the handlers is worked out
once and kept until a node comes, goes or changes. All receivers are handed the same ``Frame`` object.
"""

from collections.abc import Sequence
from functools import partial
from typing import Final

from bus_sim.can.faults import FaultInjector, FaultKind
from bus_sim.can.node import FrameRoute, SimulatedBus
from bus_sim.virtual_time import Clock
from onboard.core.frame import Frame

#: Where there are more than this many different identifiers (a fuzzer), routes are worked out anew.
_ROUTES_LIMIT: Final = 16384


def _deaf(_frame: Frame, _time_us: int) -> None:
    """Stand in for the handler of a node that left while a frame was being handed round."""


class FrameDelivery:
    """Hands frames to the nodes that hear the bus."""

    def __init__(self, clock: Clock, injectors: Sequence[FaultInjector]) -> None:
        #: Nodes that take part (attached, not off the bus), in order of attachment; kept by the medium.
        self.listeners: list[SimulatedBus] = []
        self._clock = clock
        self._injectors = [i for i in injectors if i.fault.kind is not FaultKind.CORRUPTION]
        self._routed: list[FrameRoute] = []
        self._senders: list[SimulatedBus] = []
        self._under_way: FrameRoute | None = None

    def add(self, injector: FaultInjector) -> None:
        """One more fault at work from now on; not a corruption, which strikes on the wire."""
        self._injectors.append(injector)

    def forget_routes(self) -> None:
        """Something that routes depend on has changed."""
        for route in self._routed:
            for node in route.prompt:
                node.count_received(route.frames)
        self._routed.clear()
        for sender in self._senders:
            sender.routes.clear()
        self._senders.clear()

    def silence(self, node: SimulatedBus) -> None:
        """A node leaves: not even a frame that is being handed round reaches it any more."""
        route = self._under_way
        if route is not None:
            for index, owner in enumerate(route.owners):
                if owner is node:
                    route.handlers[index] = _deaf
        self.forget_routes()

    def deliver(self, frame: Frame, key: int, excepted: Sequence[SimulatedBus], now_us: int) -> None:
        """Hand a frame with arbitration field ``key`` to all but ``excepted``, of whom the first sent it."""
        route = self._route(frame, key, excepted)
        if self._injectors:
            copies = self._strike(route, frame, now_us)
            if copies:
                self._deliver_copies(route, frame, now_us, copies)
                return
        route.frames += 1
        self._under_way = route
        for handler in route.handlers:
            handler(frame, now_us)
        self._under_way = None
        for node in route.slow:
            node.receive(frame, now_us)

    def _route(self, frame: Frame, key: int, excepted: Sequence[SimulatedBus]) -> FrameRoute:
        sender = excepted[0]
        usual = len(excepted) == 1
        route = sender.routes.get(key) if usual else None
        if route is None:
            if len(self._routed) >= _ROUTES_LIMIT:
                self.forget_routes()
            route = FrameRoute(node for node in self.listeners if node not in excepted and node.accepts(frame))
            self._routed.append(route)
            if usual:
                self._senders.append(sender)
                sender.routes[key] = route
        return route

    def _strike(self, route: FrameRoute, frame: Frame, now_us: int) -> dict[SimulatedBus, list[int]]:
        """Let the faults strike: the delays, in microseconds, of each copy that a struck node hears, perhaps none."""
        copies: dict[SimulatedBus, list[int]] = {}
        for injector in self._injectors:
            if injector.concerns(frame, now_us):
                for node in route.victims(injector):
                    if injector.strikes():
                        _change(copies.setdefault(node, [0]), injector)
        return copies

    def _deliver_copies(
        self, route: FrameRoute, frame: Frame, now_us: int, copies: dict[SimulatedBus, list[int]]
    ) -> None:
        for node in route.everybody:
            for delay_us in copies.get(node, (0,)):
                if delay_us:
                    self._clock.at_us(now_us + delay_us, partial(_receive_late, node, frame))
                elif node.is_open:
                    node.receive(frame, now_us)


def _change(delays_us: list[int], injector: FaultInjector) -> None:
    match injector.fault.kind:
        case FaultKind.OMISSION:
            delays_us.clear()
        case FaultKind.DUPLICATE if delays_us:
            delays_us.append(delays_us[0] + injector.fault.delay_us)
        case FaultKind.DELAY if delays_us:
            delays_us[0] += injector.fault.delay_us


def _receive_late(node: SimulatedBus, frame: Frame, now_us: int) -> None:
    if node.is_open:
        node.receive(frame, now_us)

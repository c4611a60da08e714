"""From the end of a frame to the receivers' handlers: who hears it, in which order, and what faults do to that.

Delivery is where a bus model spends its time, so the way from a sender's identifier to the handlers is worked out
once and kept until a node comes, goes or changes. All receivers are handed the same ``Frame`` object.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Final

from bus_sim.can.faults import FaultInjector, FaultKind
from bus_sim.can.node import SimulatedBus
from bus_sim.virtual_time import Clock
from onboard.core.frame import Frame
from onboard.ports.bus import FrameHandler

#: Where there are more than this many different identifiers (a fuzzer), routes are worked out anew.
_ROUTES_LIMIT: Final = 16384


class Route:
    """Handlers that hear one identifier of one sender, in order of attachment, and how many frames went this way."""

    __slots__ = ("frames", "handlers", "nodes", "owners", "slow")

    def __init__(self, nodes: Iterable[SimulatedBus]) -> None:
        self.frames = 0
        self.nodes: list[SimulatedBus] = []
        self.slow: list[SimulatedBus] = []
        self.handlers: list[FrameHandler] = []
        self.owners: list[SimulatedBus] = []
        for node in nodes:
            if node.is_prompt:
                self.nodes.append(node)
                self.handlers += node.frame_handlers
                self.owners += [node] * len(node.frame_handlers)
            else:
                # A busy node's handlers run later anyway; only its queue's turn among the prompt ones is lost.
                self.slow.append(node)


def _deaf(_frame: Frame, _time_us: int) -> None:
    """Stand in for the handler of a node that left while a frame was being handed round."""


class Delivery:
    """Hands frames to the nodes that hear the bus."""

    def __init__(self, clock: Clock, injectors: Sequence[FaultInjector]) -> None:
        #: Nodes that take part (attached, not off the bus), in order of attachment; kept by the medium.
        self.listeners: list[SimulatedBus] = []
        self._clock = clock
        self._injectors = tuple(i for i in injectors if i.fault.kind is not FaultKind.CORRUPTION)
        self._routed: list[Route] = []
        self._senders: list[SimulatedBus] = []
        self._under_way: Route | None = None

    def forget_routes(self) -> None:
        """Something that routes depend on has changed."""
        for route in self._routed:
            for node in route.nodes:
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
        if self._injectors:
            struck = [i for i in self._injectors if i.concerns(frame, now_us)]
            if struck:
                self._deliver_struck(frame, excepted, now_us, struck)
                return
        route = self._route(frame, key, excepted)
        route.frames += 1
        self._under_way = route
        for handler in route.handlers:
            handler(frame, now_us)
        self._under_way = None
        for node in route.slow:
            node.receive(frame, now_us)

    def _route(self, frame: Frame, key: int, excepted: Sequence[SimulatedBus]) -> Route:
        sender = excepted[0]
        usual = len(excepted) == 1
        route = sender.routes.get(key) if usual else None
        if route is None:
            if len(self._routed) >= _ROUTES_LIMIT:
                self.forget_routes()
            route = Route(node for node in self.listeners if node not in excepted and node.accepts(frame))
            self._routed.append(route)
            if usual:
                self._senders.append(sender)
                sender.routes[key] = route
        return route

    def _deliver_struck(
        self, frame: Frame, excepted: Sequence[SimulatedBus], now_us: int, struck: Sequence[FaultInjector]
    ) -> None:
        for node in list(self.listeners):
            if node in excepted or not node.accepts(frame):
                continue
            for delay_us in _copies(node, struck):
                if delay_us:
                    self._clock.at_us(now_us + delay_us, partial(_receive_late, node, frame))
                else:
                    node.receive(frame, now_us)


def _copies(node: SimulatedBus, struck: Sequence[FaultInjector]) -> list[int]:
    """The delays, in microseconds, of each copy of a frame that a node hears; empty where it hears none."""
    copies = [0]
    for injector in struck:
        if not injector.chooses(node.name, node.node_id) or not injector.strikes():
            continue
        match injector.fault.kind:
            case FaultKind.OMISSION:
                return []
            case FaultKind.DUPLICATE:
                copies.append(copies[0] + injector.fault.delay_us)
            case FaultKind.DELAY:
                copies[0] += injector.fault.delay_us
    return copies


def _receive_late(node: SimulatedBus, frame: Frame, now_us: int) -> None:
    if node.is_open:
        node.receive(frame, now_us)

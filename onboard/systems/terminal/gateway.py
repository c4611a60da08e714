"""A terminal at the gateway: a transport is a mission of its desk, for one box (rows M05, M39)."""

from collections.abc import Callable
from typing import Any

from onboard.contract.messages import Message
from onboard.contract.terminal import BoxOrder
from onboard.gateway.bus_orders import (
    BusOrders,
    NoBusOrders,
    OrderMessages,
    RefusedError,
    refuse_charging,
    refuse_fetch_at,
)
from onboard.gateway.edge import SystemEdge
from onboard.gateway.order import GatewayOrder, OrderRequest
from onboard.gateway.positions import MachinePosition, Tracker
from onboard.gateway.records import OrderPhase
from onboard.history.history import Fact, History
from onboard.history.loads import LoadTold
from onboard.systems.terminal.history import LegTold, RouteTold, StepTold, terminal_history
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.view import SiteView

#: An order is said again so often until the desk answers it, us; as vehicles do.
ORDER_AGAIN_US = 1_000_000
#: The longest time that a terminal's desk is told, s (dbc/terminal.dbc).
MOST_WITHIN_S = 32_767


class TerminalOrders(NoBusOrders):
    """A container terminal: a mission of its desk, for one box (rows M05, M39)."""

    def __init__(self, site: Terminal) -> None:
        super().__init__(site)
        self._terminal = site
        self._boxes = {box.name: number for number, box in enumerate(site.boxes, start=1)}
        stations = [one for one in site.entities.values() if one.kind is EntityKind.STATION]
        self._stations = {one.name: one.number for one in stations}

    def transport(self, body: dict[str, Any]) -> OrderRequest:
        """``load``, a box by its name, ``to`` a station."""
        refuse_charging(body)
        refuse_fetch_at(body)
        for key in ("load", "to"):
            if key not in body:
                raise RefusedError("INCOMPLETE", "name the box and the station", f"$.{key}")
        if body["load"] not in self._boxes:
            raise RefusedError("UNKNOWN_LOAD", "no box of this name", "$.load")
        if body["to"] not in self._stations:
            raise RefusedError("UNKNOWN_PLACE", f"no station; one of {', '.join(self._stations)}", "$.to")
        stops = (self._boxes[body["load"]], self._stations[body["to"]])
        return OrderRequest("send", self._terminal.desk, stops=stops, urgent=body.get("priority", 0) > 0)

    def say(self, order: GatewayOrder, sender: int, wall_us: int) -> OrderMessages:
        """The order, until the desk answers."""
        request, within_s = order.request, 0
        if order.before_us is not None:
            within_s = min(max(1, (order.before_us - wall_us) // 1_000_000), MOST_WITHIN_S)
        box, station = request.stops
        return OrderMessages(
            (BoxOrder(sender, request.node, request.number, box, station, within_s, request.urgent),), ORDER_AGAIN_US
        )

    def is_done(self, order: GatewayOrder, fact: Fact | None) -> bool:
        """The box stands there: the vehicle's own report may have been lost."""
        if not isinstance(fact, LoadTold) or order.life in (OrderPhase.ACCEPTED, OrderPhase.CALLED):
            return False
        box, station = order.request.stops
        return (fact.word.car.number, fact.word.station) == (box, station)


class EntityTracker:
    """Vehicles of a terminal: entities by name, no coordinates."""

    def __init__(self, site: Terminal, history: History) -> None:
        self._site = site
        self._vehicles = terminal_history(history).vehicles

    def take(self, message: Message, fact: Fact | None) -> bool:
        """Plans and the steps done of them."""
        return isinstance(fact, RouteTold | LegTold | StepTold)

    def where(self, node_id: int) -> MachinePosition:
        """The entity where the vehicle is, and those of its plan that lie ahead."""
        vehicle = self._vehicles[node_id]
        here, ahead = self._name(vehicle.entity), list[str]()
        if len(vehicle.steps) >= vehicle.count:
            for step in vehicle.to_come():
                name = self._name(step.entity)
                if name != (ahead[-1] if ahead else here):
                    ahead.append(name)
        return MachinePosition(here, tuple(ahead), vehicle.passed, vehicle.is_driving)

    def _name(self, number: int) -> str:
        entity = self._site.entities.get(number)
        return entity.name if entity is not None else str(number)


class TerminalEdge(SystemEdge):
    """A terminal: entities by their names."""

    def __init__(self, site: Terminal) -> None:
        super().__init__(site)
        self._terminal = site

    def bus_orders(self, view: SiteView, place: Callable[[int], str | None]) -> BusOrders:
        """Orders from outside become missions for one box."""
        return TerminalOrders(self._terminal)

    def tracker(self, history: History) -> Tracker:
        """By the plans that vehicles tell."""
        return EntityTracker(self._terminal, history)

    def place(self, number: int) -> str | None:
        """An entity's name by its number; None where the site has none."""
        return self._terminal.entities[number].name if number in self._terminal.entities else None


EDGE = TerminalEdge

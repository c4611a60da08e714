"""What orders become on the bus, system by system: the smallest true form of each.

Car park: a transport is a ticket put into a compartment's desk from afar, or its key pressed (row P52): the same path
as a customer's press, and the compartment calls for it. Factory graph: an order to a robot by name is a list of nodes
to visit (row G11). What a system has no such form for is refused.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from onboard.core.codes import ANY_STATION, OUTSIDE, KindCode, Operation, OperatorAction
from onboard.core.messages import CallForProposals, CarAt, Message, OperatorOrder, Reference, SyncRequest
from onboard.core.site import Site
from onboard.gateway.order import Life, Order, Wish
from onboard.systems.car_park.site import CarPark
from onboard.systems.graph.messages import VisitList, five
from onboard.systems.graph.site import MAX_STOPS, FactoryGraph
from onboard.systems.mapd.site import Mapd
from onboard.systems.terminal.messages import BoxOrder
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.view import SiteView
from onboard.ways.site import way_site

#: A ticket is put in again so often until the call for it is heard, us; a compartment passes a second one over. Ours.
TICKET_AGAIN_US = 30_000_000
#: A key press is not repeated, for the next car may be another's: heard within this, or refused, us. Ours.
KEY_PATIENCE_US = 20_000_000
#: A visit list is said again so often until its robot answers, us; as by kinds/graph/desk.
VISIT_AGAIN_US = 1_000_000
#: The longest time that a terminal's desk is told, s (dbc/terminal.dbc).
MOST_WITHIN_S = 32_767
#: After its start a gateway asks all what they vouch for, and knows the cars so much later, us. Ours.
LISTEN_US = 3_000_000


class RefusedError(Exception):
    """An order that means nothing here: ``reason`` is a word of docs/mqtt.md, ``path`` the place in it."""

    def __init__(self, reason: str, why: str, path: str = "$") -> None:
        super().__init__(f"{path}: {why}")
        self.reason, self.why, self.path = reason, why, path


@dataclass(frozen=True, slots=True)
class Said:
    """What is said for an order now, and when again, us from now; None for never."""

    messages: tuple[Message, ...]
    again_us: int | None


class Wishes(Protocol):
    """One system's way. ``no_pause`` tells why its machines cannot be held; empty where they can."""

    no_pause: str

    def ask_all(self, sender: int) -> tuple[Message, ...]:
        """What is asked of all machines at the start."""

    def transport(self, told: dict[str, Any]) -> Wish:
        """A transport's wish. Raises ``RefusedError``."""

    def visit(self, node: int, told: dict[str, Any], since: tuple[str, int] | None = None) -> Wish:
        """A VDA 5050 order's wish to a robot; an update's from ``since`` on. Raises ``RefusedError``."""

    def say(self, order: Order, sender: int, wall_us: int) -> Said:
        """Say an order, for the first time or again, at a wall time. Raises ``RefusedError``."""

    def task_of(self, order: Order, message: Message) -> Reference | None:
        """The task that an order has become, where this message tells."""

    def is_done(self, order: Order, message: Message) -> bool:
        """Whether this message tells that what the order asks for is so, whoever did it."""


def wishes_of(site: Site, view: SiteView, place: Callable[[int], str | None]) -> Wishes:
    """The way of a site's system; ``place`` names a station by its number."""
    if isinstance(site, FactoryGraph):
        return GraphWishes(site)
    if isinstance(site, Terminal):
        return TerminalWishes(site)
    return ParkWishes(site, view, place) if isinstance(site, CarPark) else NoWishes(site)


class NoWishes:
    """A system that orders cannot be given to in this way."""

    def __init__(self, site: Site) -> None:
        self._site = site
        in_step = isinstance(site, Mapd)
        self.no_pause = (
            "not supported: these robots move in step, and one that is held would hold all" if in_step else ""
        )

    def ask_all(self, sender: int) -> tuple[Message, ...]:
        """What they vouch for, and who is held."""
        return (SyncRequest(sender, 0),)

    def transport(self, told: dict[str, Any]) -> Wish:
        """None is taken."""
        raise RefusedError("UNSUPPORTED", f"a {self._site.system} takes no transports from outside its desks")

    def visit(self, node: int, told: dict[str, Any], since: tuple[str, int] | None = None) -> Wish:
        """None is taken."""
        raise RefusedError("UNSUPPORTED", f"machines of a {self._site.system} take no orders by name")

    def say(self, order: Order, sender: int, wall_us: int) -> Said:
        """Nothing was taken."""
        raise RefusedError("UNSUPPORTED", "not of this site")

    def task_of(self, order: Order, message: Message) -> Reference | None:
        """None."""
        return None

    def is_done(self, order: Order, message: Message) -> bool:
        """Only a report tells."""
        return False


class ParkWishes(NoWishes):
    """A robotized car park; ``view`` is what was heard of it."""

    def __init__(self, site: Site, view: SiteView, place: Callable[[int], str | None]) -> None:
        super().__init__(site)
        self._view, self._place = view, place
        self._desks = {
            machine.name: node for node, machine in site.machines.items() if node in way_site(site).compartments
        }

    def transport(self, told: dict[str, Any]) -> Wish:
        """``to`` a compartment: fetch. ``from`` a compartment: park what stands in it."""
        urgent = told.get("priority", 0) > 0
        _no_load(told)
        if "to" in told:
            node = self._desk(told["to"], "$.to")
            if "car" not in told and "from" not in told:
                raise RefusedError("INCOMPLETE", "name the car, or from where", "$.car")
            car = _car(told["car"]) if "car" in told else self._standing(told["from"])
            return Wish("fetch", node, car, urgent=urgent)
        if "from" not in told:
            raise RefusedError("INCOMPLETE", "name a compartment to hand out at, or one to park from", "$.to")
        return Wish("park", self._desk(told["from"], "$.from"), urgent=urgent)

    def say(self, order: Order, sender: int, wall_us: int) -> Said:
        """A ticket, or the key."""
        wish = order.wish
        if wish.car is None:
            if order.was_said:
                raise RefusedError("NOT_TAKEN", "the compartment has not called for it: no car in it, or not ready")
            return Said((OperatorOrder(sender, wish.node, OperatorAction.PRESS_KEY, Reference(0, 0)),), KEY_PATIENCE_US)
        if wish.car not in self._view.cars:
            raise RefusedError("UNKNOWN_TICKET", "no such car is in the park", "$.car")
        action = OperatorAction.URGENT_TICKET if wish.urgent else OperatorAction.INSERT_TICKET
        return Said((OperatorOrder(sender, wish.node, action, wish.car),), TICKET_AGAIN_US)

    def task_of(self, order: Order, message: Message) -> Reference | None:
        """The compartment's call for the car, or its next call to park."""
        if not isinstance(message, CallForProposals) or message.sender != order.wish.node or message.depth:
            return None
        if order.wish.car is None:
            return message.task if message.operation is Operation.PARK and order.was_said else None
        is_it = message.operation is Operation.RETRIEVE and message.car == order.wish.car
        return message.task if is_it else None

    def is_done(self, order: Order, message: Message) -> bool:
        """The car has left; or it stands in a place, and its parking was the task, which has the car's own name."""
        if not isinstance(message, CarAt) or order.task is None:
            return False
        if order.wish.car is not None:
            return message.car == order.wish.car and message.station == OUTSIDE
        bays = {station.number for station in way_site(self._site).compartments.values()}
        return message.car == order.task and message.station not in (*bays, ANY_STATION, OUTSIDE)

    def _desk(self, name: str, path: str) -> int:
        if name not in self._desks:
            raise RefusedError("UNKNOWN_PLACE", f"no compartment; one of {', '.join(self._desks)}", path)
        return self._desks[name]

    def _standing(self, place: str) -> Reference:
        for number, car in self._view.places_taken().items():
            if self._place(number) == place:
                return car
        raise RefusedError("UNKNOWN_TICKET", "no car is known to stand there", "$.from")


class TerminalWishes(NoWishes):
    """A container terminal: a mission of its desk, for one box (rows M05, M39)."""

    def __init__(self, site: Terminal) -> None:
        super().__init__(site)
        self._terminal = site
        self._boxes = {box.name: number for number, box in enumerate(site.boxes, start=1)}
        stations = [one for one in site.entities.values() if one.kind is EntityKind.STATION]
        self._stations = {one.name: one.number for one in stations}

    def transport(self, told: dict[str, Any]) -> Wish:
        """``load``, a box by its name, ``to`` a station."""
        for key in ("load", "to"):
            if key not in told:
                raise RefusedError("INCOMPLETE", "name the box and the station", f"$.{key}")
        if told["load"] not in self._boxes:
            raise RefusedError("UNKNOWN_LOAD", "no box of this name", "$.load")
        if told["to"] not in self._stations:
            raise RefusedError("UNKNOWN_PLACE", f"no station; one of {', '.join(self._stations)}", "$.to")
        stops = (self._boxes[told["load"]], self._stations[told["to"]])
        return Wish("send", self._terminal.desk, stops=stops, urgent=told.get("priority", 0) > 0)

    def say(self, order: Order, sender: int, wall_us: int) -> Said:
        """The order, until the desk answers."""
        wish, within_s = order.wish, 0
        if order.before_us is not None:
            within_s = min(max(1, (order.before_us - wall_us) // 1_000_000), MOST_WITHIN_S)
        box, station = wish.stops
        return Said((BoxOrder(sender, wish.node, wish.number, box, station, within_s, wish.urgent),), VISIT_AGAIN_US)

    def is_done(self, order: Order, message: Message) -> bool:
        """The box stands there: the vehicle's own report may have been lost."""
        if not isinstance(message, CarAt) or order.life in (Life.ACCEPTED, Life.CALLED):
            return False
        box, station = order.wish.stops
        return (message.car.number, message.station) == (box, station)


class GraphWishes(NoWishes):
    """A factory graph."""

    def __init__(self, site: FactoryGraph) -> None:
        super().__init__(site)
        self._graph = site

    def transport(self, told: dict[str, Any]) -> Wish:
        """``from`` one node ``to`` another: a desk calls for it, and the robot that does it best has it (row G28)."""
        desks = sorted(node for node, one in self._graph.machines.items() if one.kind is KindCode.DESK)
        if not desks:
            raise RefusedError("UNSUPPORTED", "this site has no desk that calls for a transport")
        _no_load(told)
        if "car" in told:
            raise RefusedError("UNSUPPORTED", "loads have no names here; say from where to where", "$.car")
        for key in ("from", "to"):
            if key not in told:
                raise RefusedError("INCOMPLETE", "say from where to where", f"$.{key}")
            self._node(told[key], f"$.{key}")
        return Wish("send", desks[0], stops=(int(told["from"]), int(told["to"])))

    def visit(self, node: int, told: dict[str, Any], since: tuple[str, int] | None = None) -> Wish:
        """The nodes with an action and the last one are stops; between them the robot goes its own way.

        Nodes that are not released yet are its horizon: nothing is done for them before an update releases them.
        """
        nodes = told["nodes"]
        for place, one in enumerate(nodes):
            self._check(one, f"$.nodes[{place}]")
        numbers = [step["sequenceId"] for step in nodes]
        if not nodes or numbers != list(range(numbers[0], numbers[0] + 2 * len(nodes), 2)):
            raise RefusedError("MALFORMED", "nodes must be there, their numbers two apart", "$.nodes")
        base = [one for one in nodes if one["released"]]
        if base != nodes[: len(base)] or not base:
            raise RefusedError("MALFORMED", "the first nodes must be released, and behind a horizon none", "$.nodes")
        if since is not None and (base[0]["nodeId"], base[0]["sequenceId"]) != since:
            why = f"must go on from node {since[0]}, sequenceId {since[1]}, the last one that was released"
            raise RefusedError("NOT_CONTINUED", why, "$.nodes[0]")
        new = base if since is None else base[1:]
        stops = tuple(int(one["nodeId"]) for one in new if one["actions"] or one is new[-1])
        if len(stops) > MAX_STOPS:
            raise RefusedError("TOO_LONG", f"at most {MAX_STOPS} stops fit into one order", "$.nodes")
        end = (base[-1]["nodeId"], base[-1]["sequenceId"])
        return Wish("visit", node, stops=stops, base=end, is_open=len(base) < len(nodes))

    def _check(self, node: dict[str, Any], path: str) -> None:
        self._node(node["nodeId"], f"{path}.nodeId")
        for number, action in enumerate(node["actions"]):
            if action["actionType"] not in ("pick", "drop"):
                where = f"{path}.actions[{number}].actionType"
                raise RefusedError("UNSUPPORTED", "of actions only pick and drop are known", where)

    def _node(self, name: str, path: str) -> None:
        if not name.isdecimal() or int(name) not in self._graph.graph.neighbours:
            raise RefusedError("UNKNOWN_PLACE", "no node of this graph", path)

    def say(self, order: Order, sender: int, wall_us: int) -> Said:
        """The list of nodes until the robot answers; without any node, that the order is taken back."""
        wish = order.wish
        stops = () if order.is_cancelled else wish.stops
        assert stops or order.is_cancelled, "an empty list takes an order back"
        return Said((VisitList(sender, wish.number, wish.node, *five(stops)),), VISIT_AGAIN_US)


def is_robot(site: Site, node: int) -> bool:
    """Whether a node is a machine that carries."""
    machine = site.machines.get(node)
    return machine is not None and machine.kind in (KindCode.ROBOT, KindCode.VEHICLE)


def _no_load(told: dict[str, Any]) -> None:
    if "load" in told:
        raise RefusedError("UNSUPPORTED", "loads have no names here", "$.load")


def _car(text: str) -> Reference:
    origin, _, number = text.partition(".")
    if int(origin) > 0xFF or int(number) > 0xFFFF:
        raise RefusedError("UNKNOWN_TICKET", "no such car can be", "$.car")
    return Reference(int(origin), int(number))

"""A factory graph at the gateway: an order to a robot by name is a list of nodes to visit (row G11)."""

from collections.abc import Callable
from typing import Any

from onboard.contract.codes import KindCode
from onboard.contract.graph import VisitList
from onboard.contract.messages import Message
from onboard.gateway.bus_orders import (
    BusOrders,
    NoBusOrders,
    OrderMessages,
    RefusedError,
    refuse_charging,
    refuse_fetch_at,
    refuse_load,
)
from onboard.gateway.edge import PhysicalLimits, SystemEdge
from onboard.gateway.order import GatewayOrder, OrderRequest
from onboard.gateway.positions import MachinePosition, Tracker
from onboard.history.history import Fact, History
from onboard.systems.graph.fields import NO_NODE, five
from onboard.systems.graph.history import RobotTold, graph_history
from onboard.systems.graph.site import MAX_STOPS, FactoryGraph
from onboard.trace.view import SiteView

#: A visit list is said again so often until its robot answers, us; as by the desk does.
VISIT_AGAIN_US = 1_000_000


class GraphOrders(NoBusOrders):
    """What orders from outside become on a factory graph: visits by a robot of that name, or by any."""

    def __init__(self, site: FactoryGraph) -> None:
        super().__init__(site)
        self._graph = site

    def transport(self, body: dict[str, Any]) -> OrderRequest:
        """``from`` one node ``to`` another: a desk calls for it, and the robot that does it best has it (row G28)."""
        desks = sorted(node for node, one in self._graph.machines.items() if one.kind is KindCode.DESK)
        if not desks:
            raise RefusedError("UNSUPPORTED", "this site has no desk that calls for a transport")
        refuse_load(body)
        refuse_charging(body)
        refuse_fetch_at(body)
        if "car" in body:
            raise RefusedError("UNSUPPORTED", "loads have no names here; say from where to where", "$.car")
        for key in ("from", "to"):
            if key not in body:
                raise RefusedError("INCOMPLETE", "say from where to where", f"$.{key}")
            self._node(body[key], f"$.{key}")
        return OrderRequest("send", desks[0], stops=(int(body["from"]), int(body["to"])))

    def visit(self, node: int, body: dict[str, Any], since: tuple[str, int] | None = None) -> OrderRequest:
        """The nodes with an action and the last one are stops; between them the robot goes its own way.

        Nodes that are not released yet are its horizon: nothing is done for them before an update releases them.
        """
        nodes = body["nodes"]
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
        return OrderRequest("visit", node, stops=stops, base=end, is_open=len(base) < len(nodes))

    def _check(self, node: dict[str, Any], path: str) -> None:
        self._node(node["nodeId"], f"{path}.nodeId")
        for number, action in enumerate(node["actions"]):
            if action["actionType"] not in ("pick", "drop"):
                where = f"{path}.actions[{number}].actionType"
                raise RefusedError("UNSUPPORTED", "of actions only pick and drop are known", where)

    def _node(self, name: str, path: str) -> None:
        if not name.isdecimal() or int(name) not in self._graph.graph.neighbours:
            raise RefusedError("UNKNOWN_PLACE", "no node of this graph", path)

    def say(self, order: GatewayOrder, sender: int, wall_us: int) -> OrderMessages:
        """The list of nodes until the robot answers; without any node, that the order is taken back."""
        request = order.request
        stops = () if order.is_cancelled else request.stops
        assert stops or order.is_cancelled, "an empty list takes an order back"
        return OrderMessages((VisitList(sender, request.number, request.node, *five(stops)),), VISIT_AGAIN_US)


class GraphTracker:
    """Robots of a factory graph: nodes by number, no coordinates."""

    def __init__(self, history: History) -> None:
        self._seen = graph_history(history)

    def take(self, message: Message, fact: Fact | None) -> bool:
        """Robots say where they are and where they go."""
        return isinstance(fact, RobotTold)

    def where(self, node_id: int) -> MachinePosition:
        """The node where the robot is, or that it left last."""
        node, passed = str(self._seen.node_of(node_id)), self._seen.passed[node_id]
        at = self._seen.robots.get(node_id)
        if at is None:
            return MachinePosition(node)
        first = (at.node,) if at.on_edge else ()
        ahead: list[str] = []
        for one in (*first, at.ahead1, at.ahead2, at.ahead3, at.goal):
            if one != NO_NODE and str(one) != (ahead[-1] if ahead else node):
                ahead.append(str(one))
        return MachinePosition(node, tuple(ahead), passed, at.on_edge)


class GraphEdge(SystemEdge):
    """A factory graph: nodes by number."""

    takes_visits = True

    def __init__(self, site: FactoryGraph) -> None:
        super().__init__(site)
        self._graph = site

    def bus_orders(self, view: SiteView, place: Callable[[int], str | None]) -> BusOrders:
        """Orders from outside become lists of visits."""
        return GraphOrders(self._graph)

    def tracker(self, history: History) -> Tracker:
        """By what robots say of their place."""
        return GraphTracker(history)

    def place(self, number: int) -> str | None:
        """A node, which orders name by its number alone."""
        return str(number)

    def body(self) -> PhysicalLimits:
        """Of a robot only its speed is known."""
        return PhysicalLimits(speed=self._graph.speed_mm_s / 1000)


EDGE = GraphEdge

"""The site file of a factory graph; docs/graph.md describes every key."""

from dataclasses import replace
from itertools import count, pairwise
from typing import Any

from onboard.config.fleet import FleetReader
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode, Side
from onboard.core.site import Segment, Station
from onboard.systems.graph.site import MAX_CAPACITY, MAX_NODE, MAX_STOPS, FactoryGraph, Graph, Rules, VisitOrder, edge

_NOWHERE = Segment(0, 0)
#: Longest edge, mm.
MAX_LENGTH_MM = 60_000


def read(root: TomlTable, common: Common) -> FactoryGraph:
    """Edges, rules, hosts of node agents, robots, desks, and the orders that a run of the site brings."""
    table = root.table("graph", required=True)
    edges, odd = _edges(table)
    graph = Graph({edge(one, other): length for one, other, length in edges})
    rules = Rules(table.choice("rules", [one.value for one in Rules], Rules.EDGE_AND_NODE.value))
    capacity = table.integer("capacity", 1, MAX_CAPACITY, 4)
    speed_mm_s = table.integer("speed_mm_s", 50, 5_000, 1_000)
    approach_mm = table.integer("approach_mm", 100, 20_000, 1_500)
    if edges and approach_mm >= min(length for _, _, length in edges):
        table.bad("approach_mm", approach_mm, "not shorter than every edge", "put the sensor nearer to the node")
    fleet = FleetReader()
    nodes = None if odd is None else {*graph.neighbours, *odd}
    hosts = _read_hosts(root, fleet, graph, nodes)
    for one in root.tables("desks"):
        fleet.add(one, KindCode.DESK, _NOWHERE)
    _read_robots(root, fleet, graph, nodes, capacity)
    for name, words in (("robots", "robot"), ("desks", "order desk"), ("hosts", "host of node agents")):
        if not root.values.get(name):
            root.bad(name, None, f"no {words}", f"add at least one [[{name}]] table")
    orders = tuple(order for one in root.tables("orders") if (order := _order(one, fleet, graph, nodes)) is not None)
    robots = sum(1 for one in fleet.by_node.values() if one.kind is KindCode.VEHICLE)
    timing = read_timing(root.table("timing"), max(1, robots), len(fleet.by_node), common.bitrate)
    return FactoryGraph(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        machines=dict(sorted(fleet.by_node.items())),
        timing=replace(timing),
        stewards=hosts,
        edges=edges,
        rules=rules,
        capacity=capacity,
        hosts=hosts,
        speed_mm_s=speed_mm_s,
        approach_mm=approach_mm,
        load_ms=table.integer("load_ms", 0, 600_000, 5_000),
        orders=orders,
    )


def _edges(table: TomlTable) -> tuple[tuple[tuple[int, int, int], ...], set[int] | None]:
    """The edges that are right; and the nodes that mistaken ones may join, None where that may be any."""
    form = f"[node, node, length in mm], nodes 0 to {MAX_NODE}, lengths 200 to {MAX_LENGTH_MM}"
    found: dict[tuple[int, int], int] = {}
    odd: set[int] | None = set()
    for number, value in enumerate(table.items("edges", f"a list of {form}") or ()):
        good = isinstance(value, list) and len(value) == 3 and all(type(one) is int for one in value)
        if not good or not (min(value[:2]) >= 0 and max(value[:2]) <= MAX_NODE and 200 <= value[2] <= MAX_LENGTH_MM):
            table.bad("edges", value, "not an edge", f"write {form}", item=number)
            named = [one for one in value[:2] if type(one) is int] if isinstance(value, list) else []
            odd = odd | {*named} if len(named) == 2 and odd is not None else None
        elif value[0] == value[1]:
            table.bad("edges", value, "from a node to itself", "join two different nodes", item=number)
            odd = None
        elif edge(value[0], value[1]) in found:
            table.bad("edges", value, "joined already", "write each edge once", item=number)
            odd = None
        else:
            found[edge(value[0], value[1])] = value[2]
    if not found and "edges" not in table.wrong:
        table.bad("edges", None, "missing", f"write a list of {form}")
    odd = odd if found else None
    if odd is not None:
        _check_edges(table, Graph(found), odd)
    return tuple((*ends, length) for ends, length in sorted(found.items())), odd


def _check_edges(table: TomlTable, graph: Graph, odd: set[int]) -> None:
    """That no node is a dead end (row G02), and that every node can be reached from every other.

    Nodes that mistaken edges may join are ``odd``: nothing is said of them.
    """
    for node in sorted({*graph.dead_ends} - odd):
        table.bad("edges", node, "a node with one edge", "give it another: robots do not reverse, so none comes out")
    lost = set(graph.nodes) - graph.nodes_network.from_any(graph.nodes[:1])
    is_first_odd = bool({*graph.nodes} - lost & odd)
    while lost:
        part = graph.nodes_network.from_any((min(lost),))
        if is_first_odd and part & odd:
            lost -= part
            continue
        what = f"cannot be reached from node {graph.nodes[0]}"
        what += f", nor can {', '.join(map(str, others))}" if (others := sorted(part)[1:]) else ""
        table.bad("edges", min(lost), what, "join them by an edge")
        lost -= part


def _read_hosts(root: TomlTable, fleet: FleetReader, graph: Graph, nodes: set[int] | None) -> dict[int, int]:
    """Which machine hosts the agent of which node; one may host many, and each node has one."""
    hosts: dict[int, int] = {}
    for table in root.tables("hosts"):
        host = fleet.add(table, KindCode.NODE, _NOWHERE)
        for number, node in enumerate(table.items("nodes", "a list of nodes of the graph") or ()):
            if not _is_node(node, nodes):
                table.bad("nodes", node, "no node of the graph", _some_nodes(graph), item=number)
            elif node in hosts:
                table.bad("nodes", node, "hosted already", "name each node at one host", item=number)
            elif type(node) is int:
                hosts[node] = host.node_id
    homeless = [node for node in graph.nodes if node not in hosts]
    if homeless and root.values.get("hosts") and root.problems.none_in("hosts", "name|node"):
        root.bad("hosts", homeless[0], "a node without host", "name it in the nodes of one of the [[hosts]]")
    return hosts


def _read_robots(root: TomlTable, fleet: FleetReader, graph: Graph, nodes: set[int] | None, capacity: int) -> None:
    slots = {node: count(1) for node in graph.nodes}
    for table in root.tables("robots"):
        at = table.integer("at", 0, MAX_NODE)
        if "at" not in table.wrong and not _is_node(at, nodes):
            table.bad("at", at, "no node of the graph", _some_nodes(graph))
        slot = next(slots[at]) if at in slots else 1
        if slot > capacity:
            table.bad("at", at, f"node with {capacity} robots already", "let it start elsewhere, or raise capacity")
        fleet.add(table, KindCode.VEHICLE, Segment(at, slot), Station(at, slot, Side.NEAR))


def _order(table: TomlTable, fleet: FleetReader, graph: Graph, nodes: set[int] | None) -> VisitOrder | None:
    at_ms = table.integer("at_s", 0, 86_400, 0) * 1000
    stops = table.items("visit", "a list of nodes of the graph")
    name = table.text("robot", "any")
    robot = fleet.by_name.get(name)
    if name != "any" and (not fleet.is_odd(name) if robot is None else robot.kind is not KindCode.VEHICLE):
        table.bad("robot", name, "no robot of this name", 'write the name of a robot, or "any"')
    words = f"write 1 to {MAX_STOPS} nodes of the graph, no two alike in a row"
    if stops is None or not 1 <= len(stops) <= MAX_STOPS:
        table.bad("visit", stops, "not a list of stops", words)
        return None
    for number, node in enumerate(stops):
        if not _is_node(node, nodes):
            table.bad("visit", node, "no node of the graph", _some_nodes(graph), item=number)
    if any(one == other for one, other in pairwise(stops)):
        table.bad("visit", stops, "a stop twice in a row", words)
    if name == "any" and len(stops) != 2:
        table.bad("visit", stops, "not from where and to where", "an order for any robot has two stops")
    return VisitOrder(at_ms, 0 if robot is None else robot.node_id, tuple(stops))


def _is_node(value: Any, nodes: set[int] | None) -> bool:
    """Whether a value is a node, or may be: None stands for nodes that are not known."""
    return type(value) is int and (nodes is None or value in nodes)


def _some_nodes(graph: Graph) -> str:
    return f"nodes of this graph are {', '.join(str(node) for node in graph.nodes[:12])}"

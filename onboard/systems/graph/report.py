"""What a factory graph is, in lines for a person: its ways, its machines, and what was proved of them."""

from onboard.config.site_report import counted, machines_line
from onboard.contract.codes import KindCode
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph

_KINDS = {KindCode.VEHICLE: "robot", KindCode.NODE: "host", KindCode.DESK: "order desk"}


def lines(site: FactoryGraph) -> list[str]:
    """Nodes and edges, machines; whether each node is reached whichever way one comes; how many robots can rest."""
    lengths_mm = site.graph.lengths_mm.values()
    metres = f"{min(lengths_mm) / 1000:g} to {max(lengths_mm) / 1000:g} m, in all {sum(lengths_mm) / 1000:g} m"
    return [
        f"nodes: {len(site.graph.nodes)}, {counted(len(site.edges), 'edge')} of {metres}",
        machines_line(site, _KINDS),
        _reached_line(site),
        _rests_line(site),
    ]


def _reached_line(site: FactoryGraph) -> str:
    graph = site.graph
    lost = [(here, goal) for goal in graph.nodes for here in graph.network.ways if here not in graph.to_go_mm(goal)]
    if not lost:
        return "reached: every node, whichever edge a robot comes by, though none reverses"
    (came_from, node), goal = lost[0]
    return f"reached: not all: from N{came_from} over N{node} no way leads to N{goal} without reversing"


def _rests_line(site: FactoryGraph) -> str:
    here = f"{counted(len(site.robots), 'robot')} here"
    if site.rules is not Rules.EDGE_AND_NODE:
        return f"rests: any number in a node, as the rules {site.rules.value} grant no slots; {here}"
    nodes = len(site.graph.nodes)
    words = f"{site.capacity - 1} in each of {nodes} nodes, whose last slot is for who passes or visits"
    return f"rests: {counted((site.capacity - 1) * nodes, 'robot')} at the same time: {words}; {here}"

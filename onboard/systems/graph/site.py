"""What the machines of a factory graph know beforehand (row G27: every robot has the whole graph)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from onboard.contract.codes import KindCode
from onboard.core.site import Machine, MotionNeeds, Site
from onboard.systems.graph.network import Edge, Graph, edge
from onboard.systems.graph.rules import Rules

__all__ = ["Edge", "FactoryGraph", "Graph", "Rules", "VisitOrder", "edge"]

#: Highest node number: a node is one byte on the wire, and 255 is none.
MAX_NODE = 254
#: Most slots of a node.
MAX_CAPACITY = 15
#: Most nodes of one order: a frame holds so many.
MAX_STOPS = 5


@dataclass(frozen=True, slots=True)
class VisitOrder:
    """An order that the demand brings after ``at_ms``: visit ``stops``; ``robot`` 0 is the nearest free one."""

    at_ms: int
    robot: int
    stops: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class FactoryGraph(Site):
    """A graph, its rules, who hosts which node agents, and the orders that a run of it brings.

    ``edges`` are (lower end, higher end, length in mm); ``hosts`` maps each node to the node-ID of its agent's host;
    ``capacity`` are the slots of every node, for the rule set that grants them.
    """

    system: ClassVar[str] = "graph"
    called: ClassVar[str] = "factory graph"
    demand: ClassVar[frozenset[str]] = frozenset({"orders"})
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {"RouteOrder": MotionNeeds.RIGHT}

    edges: tuple[tuple[int, int, int], ...]
    rules: Rules
    capacity: int
    hosts: dict[int, int]
    speed_mm_s: int
    approach_mm: int
    load_ms: int
    orders: tuple[VisitOrder, ...] = ()

    @cached_property
    def graph(self) -> Graph:
        """The edges as a graph."""
        return Graph({edge(one, other): length for one, other, length in self.edges})

    @cached_property
    def robots(self) -> dict[int, Machine]:
        """The robots by node-ID; each one's home is its node and its slot there."""
        return {node: one for node, one in self.machines.items() if one.kind is KindCode.VEHICLE}

    @cached_property
    def desks(self) -> tuple[int, ...]:
        """Node-IDs of the order desks, lowest first."""
        return tuple(node for node, one in sorted(self.machines.items()) if one.kind is KindCode.DESK)

    def agent_of(self, ends: Edge) -> int:
        """The host that keeps an edge's right while nobody travels on it: that of its lower end."""
        return self.hosts[ends[0]]

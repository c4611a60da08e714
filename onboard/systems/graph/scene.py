"""The factory graph's plan: nodes and edges, robots on them, who may use which edge, and where each robot goes."""

from dataclasses import dataclass

from onboard.contract.graph import EdgeState, RobotAt
from onboard.contract.messages import Message
from onboard.history.history import Fact
from onboard.systems.graph.fields import NO_NODE, stops_of
from onboard.systems.graph.history import RobotTold, VisitsTold, graph_history
from onboard.systems.graph.site import FactoryGraph
from onboard.trace.scene.arrange import arrange
from onboard.trace.scene.scene import NEARLY, Json, Spot, along, shape, still
from onboard.trace.view import SiteView

#: Plan units between the two nearest nodes, and around all.
APART, MARGIN = 170.0, 60.0
#: Robots in one node stand so far beside each other.
BESIDE = 20.0


@dataclass
class _SeenRobot:
    """Where one robot is by its last word, and how it moves meanwhile."""

    node: int
    behind: int = NO_NODE
    is_on_edge: bool = False
    mode: str = ""
    ahead: tuple[int, ...] = ()
    goal: int = NO_NODE
    path: list[list[float]] | None = None


class GraphScene:
    """Fed beside ``view``, which knows the calls."""

    def __init__(self, site: FactoryGraph, view: SiteView) -> None:
        self.site = site
        self.view = view
        self.words = view.words
        lengths = {(one, other): float(length) for one, other, length in site.edges}
        nodes = arrange(lengths, sorted({node for ends in lengths for node in ends}), APART)
        self._spots = {node: (x + MARGIN, y + MARGIN) for node, (x, y) in nodes.items()}
        self._lengths = {frozenset(ends): length for ends, length in lengths.items()}
        self._robots = {node: _SeenRobot(machine.home.track) for node, machine in site.robots.items()}
        self._edges = graph_history(view.history).edges

    def layout(self) -> Json:
        """Nodes, and edges with their length in m, as a plan."""
        shapes = [
            shape(_edge_id(one, other), "edge", f"{length / 1000:g} m", [self._spots[one], self._spots[other]])
            for one, other, length in self.site.edges
        ]
        shapes += [shape(f"n{node}", "node", f"N{node}", [spot]) for node, spot in self._spots.items()]
        width = max(x for x, _ in self._spots.values()) + MARGIN
        height = max(y for _, y in self._spots.values()) + MARGIN
        return {"plan": {"width": width, "height": height, "shapes": shapes}}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Follow robots, edges, orders and calls for the plan."""
        match fact:
            case RobotTold():
                self._on_robot(fact.word, time_us)
            case VisitsTold(word=word, is_first=True) if word.robot:
                ways = ", ".join(f"N{node}" for node in stops_of(word))
                self.view.say(time_us, f"{self.view.name(word.robot)} is to visit {ways}")

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """The fleet bus tells all that is drawn."""

    def _on_robot(self, at: RobotAt, time_us: int) -> None:
        robot = self._robots[at.sender]
        length = self._lengths.get(frozenset((at.behind, at.node)))
        if at.node not in self._spots or (at.on_edge and length is None):
            return
        is_news = (at.node, at.behind, at.on_edge) != (robot.node, robot.behind, robot.is_on_edge)
        robot.node, robot.behind, robot.is_on_edge = at.node, at.behind, at.on_edge
        robot.mode = at.robot_mode.name.lower()
        robot.ahead = tuple(node for node in (at.ahead1, at.ahead2, at.ahead3) if node in self._spots)
        robot.goal = at.goal
        if not is_news:
            return
        if at.on_edge and length is not None:
            # The edge is told when the robot is on it; its line before the node is where it waits to be let in.
            share = max(0.1, 1 - self.site.approach_mm / length / 2)
            ends = [self._spots[at.behind], self._spots[at.node]]
            until_us = time_us + round(length * min(share, NEARLY) / self.site.speed_mm_s * 1e6)
            robot.path = along(ends, time_us, until_us, min(share, NEARLY))
        else:
            robot.path = None

    def machine(self, node: int, now_us: int) -> Json:
        """Where a robot is; of a host, which nodes' agents it runs."""
        robot = self._robots.get(node)
        if robot is None:
            hosted = [f"N{one}" for one, host in sorted(self.site.hosts.items()) if host == node]
            return {"where": f"agent of {' '.join(hosted)}" if hosted else "", "car": None}
        where = f"N{robot.behind} to N{robot.node}" if robot.is_on_edge else f"N{robot.node}"
        edges = [
            [_edge_id(*sorted(ends)), []]
            for ends, word in self._edges.items()
            if word.robot == node and word.edge_state is not EdgeState.FREE
        ]
        told = [f"goes to N{robot.goal}"] if robot.goal in self._spots else []
        return {
            "where": f"{where}, {robot.mode}" if robot.mode else where,
            "car": None,
            "path": robot.path if robot.path is not None else still(self._beside(node, robot)),
            "ahead": [[round(x, 1), round(y, 1)] for x, y in self._ahead(robot)],
            "held": edges,
            "told": [[None, line] for line in told],
        }

    def _ahead(self, robot: _SeenRobot) -> list[Spot]:
        nodes = [robot.node, *robot.ahead]
        return [self._spots[node] for node in nodes] if robot.ahead or robot.is_on_edge else []

    def _beside(self, node: int, robot: _SeenRobot) -> Spot:
        """Robots in one node stand side by side, the lowest node-ID first."""
        x, y = self._spots[robot.node]
        there = [one for one, other in self._robots.items() if other.node == robot.node and not other.is_on_edge]
        return x + (there.index(node) - (len(there) - 1) / 2) * 2 * BESIDE, y

    def marks(self, now_us: int) -> Json:
        """Edges that somebody may use, with the robot's name."""
        marks: Json = {}
        for ends, word in self._edges.items():
            if word.edge_state is not EdgeState.FREE and word.robot:
                words = f"{word.edge_state.name.lower()} for {self.view.name(word.robot)}"
                marks[_edge_id(*sorted(ends))] = {"state": "held", "lines": [words]}
        return {"marks": marks, "things": []}


def _edge_id(one: int, other: int) -> str:
    return f"e{one}-{other}"


SCENE = GraphScene

"""A factory graph over time: a row a node, neighbours near each other, and robots from node to node."""

from onboard.contract.graph import RobotAt, RobotMode
from onboard.contract.messages import Message
from onboard.history.history import Fact
from onboard.systems.graph.history import RobotTold
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.graph.words import node_name
from onboard.trace.chart.over_time import Bar, Panel, PanelLine, Rows, by_distance


class GraphDiagram(Rows):
    """Robots by what they say of their place; a bar where one loads."""

    legend = "line: on its way; bar: loading"

    def __init__(self, site: FactoryGraph, from_us: int | None, until_us: int | None) -> None:
        super().__init__(site, from_us, until_us)
        self._site = site
        nodes = site.graph.nodes
        far = [site.graph.nodes_network.costs_to((node,)) for node in nodes]
        order = [nodes[number] for number in by_distance([[row[node] for node in nodes] for row in far])]
        self._rows = {node: float(row) for row, node in enumerate(order)}
        self._panel = Panel("nodes", [node_name(node) for node in order])
        self.panels = [self._panel]
        self._lines = {node: PanelLine(node, []) for node in site.robots}
        self._leaving: dict[int, tuple[int, RobotAt]] = {}
        self._loading: dict[int, tuple[int, int]] = {}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """A robot's word of the node where it is becomes a point of its line."""
        if isinstance(fact, RobotTold) and fact.word.node in self._rows:
            self._on_robot(fact.word, time_us)

    def _on_robot(self, at: RobotAt, time_us: int) -> None:
        points, left = self._lines[at.sender].points, self._leaving.pop(at.sender, None)
        if at.on_edge and at.behind in self._rows:
            if left is not None and (left[1].behind, left[1].node) == (at.behind, at.node):
                self._leaving[at.sender] = left
                return
            points.append((time_us, self._rows[at.behind]))
            self._leaving[at.sender] = time_us, at
        else:
            if left is not None:
                self._wait_at_line(points, left, time_us)
            points.append((time_us, self._rows[at.node]))
        self._on_mode(at, time_us)

    def _wait_at_line(self, points: list[tuple[int, float]], left: tuple[int, RobotAt], time_us: int) -> None:
        """It goes at its speed as far as the line before the node, and stands there until it is let in."""
        begin_us, at = left
        length_mm = self._site.graph.length_mm(at.behind, at.node)
        there_us = begin_us + (length_mm - self._site.approach_mm) * 1_000_000 // self._site.speed_mm_s
        if there_us < time_us:
            share = 1 - self._site.approach_mm / length_mm
            low, high = self._rows[at.behind], self._rows[at.node]
            points.append((there_us, low + (high - low) * share))
            leaves_us = time_us - self._site.approach_mm * 1_000_000 // self._site.speed_mm_s
            points.append((max(there_us, leaves_us), low + (high - low) * share))

    def _on_mode(self, at: RobotAt, time_us: int) -> None:
        since = self._loading.pop(at.sender, None)
        if at.robot_mode is RobotMode.LOADING:
            self._loading[at.sender] = since or (time_us, at.node)
        elif since is not None:
            self._load(at.sender, since, time_us)

    def _load(self, node: int, since: tuple[int, int], until_us: int) -> None:
        row = self._rows[since[1]]
        self._panel.bars.append(Bar(node, row - 0.3, row + 0.3, since[0], until_us))

    def end(self, time_us: int) -> None:
        """Robots that stand, or are on their way, are so to the end."""
        for node, line in self._lines.items():
            if line.points:
                line.points.append((time_us, line.points[-1][1]))
                self._panel.lines.append(line)
            if node in self._loading:
                self._load(node, self._loading[node], time_us)


DIAGRAM = GraphDiagram

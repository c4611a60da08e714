"""All interleavings of robots under the node agents' rules: what can happen next in a state (SYSTEMS, section 2.4).

A robot goes from its start to its goal by the shortest way without reversing; one robot an edge. Under the paper's
rules a node holds any number of robots, and a robot that is told to stop waits on its edge. Under ``EDGE_AND_NODE`` it
waits in a node, and a node has ``capacity`` slots, robots that have come to their goal included.
"""

from dataclasses import dataclass
from typing import NamedTuple

from onboard.systems.graph.network import NOWHERE, Edge, Graph, edge
from onboard.systems.graph.rules import Heading, Rules, are_head_on, kept_edge, may_enter, other_edges

#: Instead of the node behind: this robot has come to its goal.
ARRIVED = -2
#: Robots that stand in a node, having come from node ``n``: ``_STANDS - n``. They still do not go back.
_STANDS = -10


class ModelRobot(NamedTuple):
    """``start`` is the node behind it while it is on an edge, ``NOWHERE``, ``ARRIVED``, or in a node."""

    start: int
    node: int
    goal: int

    @property
    def came_from(self) -> int:
        """The node to which it may not go back."""
        return _STANDS - self.start if self.start <= _STANDS else self.start


#: One robot each, and under ``KEEP_ON_NOTICE`` behind them what nodes keep: from ``node`` to ``goal``, ``start`` is
#: ``KEEPS``. Where names do not matter all are sorted.
State = tuple[ModelRobot, ...]
KEEPS = -1_000


class ModelMove(NamedTuple):
    """One thing that can happen: robot number ``robot`` goes on to ``node``; ``word`` says how."""

    robot: int
    word: str
    node: int


@dataclass(frozen=True)
class GraphModel:
    """The rules on one graph. ``capacity`` of every node, for ``EDGE_AND_NODE`` only."""

    graph: Graph
    rules: Rules
    capacity: int = 1

    def start(self, starts: tuple[int, ...], goals: tuple[int, ...]) -> State:
        """All robots in their first nodes."""
        return tuple(ModelRobot(NOWHERE, *ends) for ends in zip(starts, goals, strict=True))

    def is_over(self, state: State) -> bool:
        """Whether all have come to their goals."""
        return all(robot.start in (ARRIVED, KEEPS) for robot in state)

    def moves(self, state: State) -> list[tuple[ModelMove, State]]:
        """Everything that can happen next, each with the state after it; no robot changes its place in the tuple."""
        on_edges = {edge(robot.start, robot.node): robot for robot in state if robot.start >= 0}
        found: list[tuple[ModelMove, State]] = []
        for number, robot in enumerate(state):
            if robot.start not in (ARRIVED, KEEPS):
                step = self._of_edge_and_node if self.rules is Rules.EDGE_AND_NODE else self._of_paper
                for move, after in step(number, robot, state, on_edges):
                    following = (*state[:number], after, *state[number + 1 :])
                    if self.rules is Rules.KEEP_ON_NOTICE:
                        following = self._noticed(robot, after, following)
                    found.append((move, following))
        return found

    # --- what nodes keep by notices (row G21, G22) -------------------------------------------------------------

    def _noticed(self, before: ModelRobot, after: ModelRobot, state: State) -> State:
        """What nodes keep once a robot has gone on: of the edge ahead its far end is told, and of the one behind."""
        kept = {(one.node, one.goal) for one in state if one.start == KEEPS}
        if after.start >= 0:
            kept.discard((after.start, after.node))
            taken = {edge(one.start, one.node) for one in state if one.start >= 0} | {edge(*one) for one in kept}
            last = kept_edge(self.graph, taken, after.node)
            if last is not None:
                kept.add((after.node, last))
        if before.start >= 0:
            kept = {one for one in kept if one[0] != before.start}
        robots = (one for one in state if one.start != KEEPS)
        return (*robots, *(ModelRobot(KEEPS, *one) for one in sorted(kept)))

    def _is_kept(self, state: State, node: int, other: int) -> bool:
        """Whether the far end of an edge keeps it."""
        return self.rules is Rules.KEEP_ON_NOTICE and ModelRobot(KEEPS, other, node) in state

    # --- robots that wait on edges -----------------------------------------------------------------------------

    def _of_paper(
        self, number: int, robot: ModelRobot, state: State, on_edges: dict[Edge, ModelRobot]
    ) -> list[tuple[ModelMove, ModelRobot]]:
        start, node, goal = robot
        if node == goal:
            return [(ModelMove(number, "arrives at", goal), ModelRobot(ARRIVED, goal, goal))]
        wants = self.graph.next_node(start, node, goal)
        if wants is None:
            return []
        if may_enter(self.graph, on_edges, node, wants, self.rules) and not self._is_kept(state, node, wants):
            return [(ModelMove(number, "goes to", wants), ModelRobot(node, wants, goal))]
        other = on_edges.get(edge(node, wants))
        if other is None or start < 0 or not are_head_on(Heading(start, node, wants), self._heading(other)):
            return []
        return [
            (ModelMove(number, "is sent to", after), ModelRobot(node, after, goal))
            for after in other_edges(self.graph, on_edges, node, start, self.rules)
            if not self._is_kept(state, node, after)
        ]

    def _heading(self, robot: ModelRobot) -> Heading:
        return Heading(robot.start, robot.node, self.graph.next_node(*robot))

    # --- robots that wait in nodes -----------------------------------------------------------------------------

    def _of_edge_and_node(
        self, number: int, robot: ModelRobot, state: State, on_edges: dict[Edge, ModelRobot]
    ) -> list[tuple[ModelMove, ModelRobot]]:
        start, node, goal = robot
        if start >= 0:
            if node == goal:
                return [(ModelMove(number, "arrives at", goal), ModelRobot(ARRIVED, goal, goal))]
            return [(ModelMove(number, "enters", node), ModelRobot(_STANDS - start, node, goal))]
        came_from = robot.came_from
        wants = self.graph.next_node(came_from, node, goal)
        if wants is None:
            return []
        if self._has_room(state, wants) and edge(node, wants) not in on_edges:
            return [(ModelMove(number, "goes to", wants), ModelRobot(node, wants, goal))]
        if self._has_room(state, wants) or not any(self._wants_back(one, wants, node) for one in state):
            return []
        return [
            (ModelMove(number, "is sent to", after), ModelRobot(node, after, goal))
            for after in other_edges(self.graph, on_edges, node, came_from, self.rules)
            if self._has_room(state, after)
        ]

    def _has_room(self, state: State, node: int) -> bool:
        return sum(one.node == node for one in state) < self.capacity

    def _wants_back(self, robot: ModelRobot, node: int, other: int) -> bool:
        """Whether a robot in ``node`` wants to go to ``other``."""
        if robot.node != node or robot.start in (ARRIVED, NOWHERE) or robot.start >= 0:
            return robot.node == node and robot.start == NOWHERE and self.graph.next_node(*robot) == other
        return self.graph.next_node(robot.came_from, node, robot.goal) == other

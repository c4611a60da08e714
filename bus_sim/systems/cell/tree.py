"""The paper's tree of contracts worked out in one place: what the robots' own negotiation is measured against.

Grown from the root by messages and built from the deepest level up, as the paper's rule does (row C11). Exhaustive:
with N robots, none asked twice on one path, at most N!/(N - 1 - k)! times 3^k goal messages go out at level k (row
C20).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import count

from onboard.systems.cell.contracts import Arm, ArmMove, Contract, Filter, Goal, filtered, moves
from onboard.systems.cell.geometry import Area, Point
from onboard.systems.cell.offers import OFFERS, OfferRule

#: Both of the paper's filters.
ALL_FILTERS = frozenset(Filter)


@dataclass
class GoalNode:
    """A goal as one robot got it: the offers that it can make, each with the answers to its sub-goal."""

    goal: Goal
    arm: Arm
    offers: list[tuple[ArmMove, list["GoalNode"]]] = field(default_factory=list)
    contract: Contract | None = None


@dataclass
class ContractTree:
    """One goal's tree. ``messages`` counts goal messages, one for each robot that a goal or sub-goal is sent to."""

    arms: tuple[Arm, ...]
    positions: dict[int, Point]
    obstacles: tuple[Area, ...] = ()
    filters: frozenset[Filter] = ALL_FILTERS
    rules: tuple[OfferRule, ...] = OFFERS
    messages: int = 0
    levels: list[list[GoalNode]] = field(default_factory=list)
    _numbers: Iterable[int] = field(default_factory=lambda: count(1))

    def solve(self, goal: Goal) -> Contract | None:
        """The best contract for a goal, or None where the goal cannot be achieved (row C19). Ties: lower node-ID."""
        roots = self._send(goal)
        while self.levels[-1]:
            self._grow()
        for level in reversed(self.levels):
            for node in level:
                self._build(node)
        return _best(roots)

    def _send(self, goal: Goal) -> list[GoalNode]:
        """One goal message to each robot that the filters let through; nobody is sent its own."""
        sender = goal.path[-1] if goal.path else 0
        told = [
            GoalNode(goal, arm)
            for arm in self.arms
            if arm.node_id != sender and filtered(goal, arm) not in self.filters
        ]
        self.messages += len(told)
        while len(self.levels) <= goal.level:
            self.levels.append([])
        self.levels[goal.level] += told
        return told

    def _grow(self) -> None:
        """Let the deepest level make its sub-goals, all of which are one level deeper."""
        level = self.levels[-1]
        self.levels.append([])
        for node in level:
            for move in self._moves(node):
                whole = move.via == node.goal.end
                sub = node.goal.part_of(node.arm.node_id, next(iter(self._numbers)), move.via)
                node.offers.append((move, [] if whole else self._send(sub)))

    def _moves(self, node: GoalNode) -> tuple[ArmMove, ...]:
        goal = node.goal
        if Filter.PREDECESSOR not in self.filters:
            # Without the filter a predecessor may work on the goal again: for it the path is empty.
            goal = Goal(goal.task, goal.part, goal.start, goal.end)
        return moves(goal, node.arm, self.positions[node.arm.node_id], self.obstacles, self.rules)

    def _build(self, node: GoalNode) -> None:
        """Row C11: answers of the level below are final when a level is built."""
        for move, answers in node.offers:
            own = move.cost(node.arm)
            below = _best(answers)
            if move.via != node.goal.end and below is None:
                continue
            cost = own + (below.cost if below is not None else 0.0)
            nodes = (node.arm.node_id, *(below.nodes if below is not None else ()))
            if node.contract is None or cost < node.contract.cost:
                node.contract = Contract(node.goal, node.arm.node_id, move, own, cost, nodes)

    def steps(self, contract: Contract) -> list[Contract]:
        """A contract and its sub-contracts, in the order in which the part is carried."""
        steps = [contract]
        while steps[-1].move.via != contract.goal.end:
            last = steps[-1]
            below = (node.contract for node in self.levels[last.goal.level + 1] if _follows(node, last))
            steps.append(min((one for one in below if one is not None), key=lambda one: (one.cost, one.node)))
        return steps


def _follows(node: GoalNode, last: Contract) -> bool:
    return node.goal.path == (*last.goal.path, last.node) and node.goal.start == last.move.via


def _best(nodes: list[GoalNode]) -> Contract | None:
    found = [node.contract for node in nodes if node.contract is not None]
    return min(found, key=lambda contract: (contract.cost, contract.node), default=None)

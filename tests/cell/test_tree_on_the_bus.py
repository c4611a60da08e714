"""The tree of contracts of the printed run, as goals, calls and bids travel (rows C10 to C13)."""

from collections.abc import Sequence

import pytest

from onboard.contract.cell import GoalPath, GoalStart, GoalTerms, OfferNodes
from onboard.contract.messages import Bid, CallForProposals, Message, Reference
from onboard.systems.cell.fields import path_of
from onboard.systems.cell.geometry import Point
from tests.cell.playing import Scene, cell
from tests.cell.witness import DESK, metres
from tests.cut import shown

R1 = 1


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The paper's goal, once."""
    return Scene(cell())


class Tree:
    """What was told of each goal before it was called for, and who bid for it."""

    def __init__(self, messages: Sequence[Message]) -> None:
        told: dict[type[Message], dict[Reference, Message]] = {GoalStart: {}, GoalTerms: {}, GoalPath: {}}
        self.start: dict[Reference, Point] = {}
        self.level: dict[Reference, int] = {}
        self.path: dict[Reference, tuple[int, ...]] = {}
        #: The goal of each call, by its initiator and number, and the order in which they were called for.
        self.goal: dict[tuple[int, int], Reference] = {}
        self.parent: dict[Reference, Reference] = {}
        self.bids: list[tuple[Reference, int]] = []
        self.nodes: dict[tuple[Reference, int], tuple[int, ...]] = {}
        for one in messages:
            match one:
                case GoalStart() | GoalTerms() | GoalPath():
                    told[type(one)][Reference(one.sender, one.goal)] = one
                case OfferNodes():
                    offered = tuple(node for node in (one.node1, one.node2, one.node3, one.node4, one.node5) if node)
                    self.nodes[Reference(one.manager, one.goal), one.sender] = offered
                case CallForProposals():
                    self._called(one, told)
                case Bid():
                    assert (one.initiator, one.call) in self.goal
                    self.bids.append((self.goal[one.initiator, one.call], one.sender))
        assert len(self.start) > 10 and self.bids

    def _called(self, call: CallForProposals, told: dict[type[Message], dict[Reference, Message]]) -> None:
        start, terms, path = (told[kind].get(call.task) for kind in (GoalStart, GoalTerms, GoalPath))
        assert isinstance(start, GoalStart) and isinstance(terms, GoalTerms) and isinstance(path, GoalPath)
        self.goal[call.sender, call.call] = call.task
        self.start[call.task], self.level[call.task] = Point(start.x_mm, start.y_mm), terms.level
        self.path[call.task] = path_of(path, terms.level)
        if call.depth:
            above = (call.parent.origin, call.parent.number)
            assert above in self.goal
            self.parent[call.task] = self.goal[above]


KINDS = (CallForProposals, Bid, GoalStart, GoalTerms, GoalPath)


def test_c10_offer_1_of_the_first_robot_finds_nobody_and_the_others_do(scene: Scene) -> None:
    """R1 calls from all three via points; nobody can bring the part on from (16, 16)."""

    def check(messages: Sequence[Message]) -> None:
        tree = Tree(messages)
        mine = {tree.start[goal]: goal for goal in tree.start if goal.origin == R1}
        assert list(mine) == [metres(16, 16), metres(22, 10), metres(10, 16)]
        answered = {goal for goal, _ in tree.bids}
        assert [mine[via] in answered for via in mine] == [False, True, True]

    shown(check, [one for _, one in scene.played.messages], *KINDS)


def test_c11_levels_are_told_and_contracts_are_built_from_the_deepest(scene: Scene) -> None:
    """Each goal is one level below that of who called for it; a bid rests on bids for deeper goals, said before it."""

    def check(messages: Sequence[Message]) -> None:
        tree = Tree(messages)
        assert set(tree.level.values()) == {0, 1, 2, 3}
        assert len(tree.parent) == sum(level > 0 for level in tree.level.values())
        for goal, parent in tree.parent.items():
            assert (tree.level[goal], tree.path[goal]) == (tree.level[parent] + 1, (*tree.path[parent], goal.origin))
        rests = 0
        for number, (goal, robot) in enumerate(tree.bids):
            assert (goal, robot) in tree.nodes
            first, *others = tree.nodes[goal, robot]
            assert first == robot
            if others:
                before = [(tree.parent.get(deeper), deeper.origin, who) for deeper, who in tree.bids[:number]]
                assert (goal, robot, others[0]) in before
                rests += 1
        assert rests >= 3
        assert tree.level[tree.bids[-1][0]] == 0 and tree.bids[-1][0].origin == DESK

    shown(check, [one for _, one in scene.played.messages], *KINDS, OfferNodes)


def test_c12_c13_nobody_bids_who_is_in_the_path_or_cannot_reach_the_start(scene: Scene) -> None:
    """What is broadcast goes to all; predecessors, and robots whose area lacks the start, say nothing to it."""

    def check(messages: Sequence[Message]) -> None:
        tree = Tree(messages)
        for goal, robot in tree.bids:
            assert robot not in tree.path[goal]
            assert scene.site.arms[robot].area.contains(tree.start[goal])
        inside = [
            (goal, node)
            for goal, start in tree.start.items()
            for node, arm in scene.site.arms.items()
            if node in tree.path[goal] and arm.area.contains(start)
        ]
        assert len(inside) > 10, "predecessors that could take it on"
        # Nor does one of them call for a part of it.
        assert not [goal for goal, parent in tree.parent.items() if goal.origin in tree.path[parent]]

    shown(check, [one for _, one in scene.played.messages], *KINDS)

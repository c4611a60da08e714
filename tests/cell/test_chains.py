"""Robots in a row, each of which reaches its two neighbours only: how long chains of contracts are, on the bus."""

from collections.abc import Sequence

from bus_sim.systems.cell.tree import ContractTree
from onboard.contract.cell import GoalPath, GoalTerms, GoalTooDeep, OfferNodes, OfferNodesMore, RefusedFor
from onboard.contract.codes import CallResult, OrderResult
from onboard.contract.messages import Award, CallForProposals, Message, Reference
from onboard.systems.cell.contracts import Goal
from tests.cell.playing import Scene, cell, goal_demand
from tests.cell.witness import DESK, arm, metres
from tests.cut import shown

PART = Reference(DESK, 1)
FIRST = 20


def row(robots: int) -> Scene:
    """A part is to go from the first of so many areas, 3 m wide, into the last."""
    arms = tuple(arm(FIRST + k, (3 * k, 0, 3 * k + 3, 3), (3 * k + 1, 1)) for k in range(robots))
    return Scene(cell(goal_demand((1, 1), (3 * robots - 1, 2)), arms=arms))


def test_c06_c20_eight_robots_bring_a_part_on_each_for_the_one_before() -> None:
    scene = row(8)
    scene.assert_sound()
    assert scene.entries[0].result is OrderResult.DONE
    nodes = tuple(range(FIRST, FIRST + 8))

    def check(messages: Sequence[Message]) -> None:
        asked = [one.task for one in messages if isinstance(one, CallForProposals) and not one.depth]
        goals = {Reference(one.sender, one.goal): one for one in messages if isinstance(one, GoalTerms)}
        paths = {Reference(one.sender, one.goal) for one in messages if isinstance(one, GoalPath)}
        awards = [one for one in messages if isinstance(one, Award) and one.result is CallResult.AWARDED]
        won = {one.winner: one.task for one in awards}
        assert tuple(sorted(won)) == nodes
        assert [won[node].origin for node in nodes] == [DESK, *nodes[:-1]]
        assert {won[node] for node in nodes} <= goals.keys() & paths
        assert [goals[won[node]].level for node in nodes] == list(range(8))
        whole = [one for one in messages if isinstance(one, OfferNodes) and one.manager == DESK]
        more = [one for one in messages if isinstance(one, OfferNodesMore) and one.manager == DESK]
        named = {(one.node1, one.node2, one.node3, one.node4, one.node5) for one in whole}
        assert {(*first, one.node6, one.node7, one.node8) for first in named for one in more} == {nodes}
        # What a robot says between two calls of the manager makes it call for one level more.
        assert asked == [PART] * 5 and [one.part for one in messages if isinstance(one, GoalTooDeep)] == [PART] * 4

    shown(check, [one for _, one in scene.played.messages], GoalTerms, GoalPath, Award, OfferNodesMore, GoalTooDeep)
    homes = {one.node_id: one.home for one in scene.site.arms.values()}
    best = ContractTree(tuple(scene.site.arms.values()), homes, ()).solve(Goal(PART, PART, metres(1, 1), metres(23, 2)))
    assert best is not None and scene.entries[0].cost_mm == round(1000 * best.cost)


def test_c20_a_goal_that_takes_nine_robots_is_refused_and_the_counter_reads_why() -> None:
    scene = row(9)
    scene.assert_sound()
    entry = scene.entries[0]
    assert (entry.result, entry.refused_for) == (OrderResult.REFUSED, RefusedFor.TOO_DEEP)
    calls = [one for _, one in scene.said(CallForProposals) if not one.depth]
    # One call for each depth, none of them opened again.
    assert [one.attempt for one in calls] == [1] * 5
    assert [one.deepest for _, one in scene.said(GoalTerms) if one.sender == DESK] == [3, 4, 5, 6, 7]
    assert {one.part for _, one in scene.said(GoalTooDeep)} == {PART}


def test_c20_what_no_robot_can_bring_on_is_refused_as_before() -> None:
    apart = (arm(FIRST, (0, 0, 3, 3), (1, 1)), arm(FIRST + 1, (5, 0, 8, 3), (6, 1)))
    scene = Scene(cell(goal_demand((1, 1), (7, 2)), arms=apart))
    scene.assert_sound()
    entry = scene.entries[0]
    assert (entry.result, entry.refused_for) == (OrderResult.REFUSED, RefusedFor.NOBODY)
    assert not list(scene.said(GoalTooDeep))

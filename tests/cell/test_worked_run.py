"""The printed run of Panescu and Miron (2006), Fig. 5, and the guards around its reading of "maximum displacement"."""

from fractions import Fraction
from pathlib import Path

import pytest

from bus_sim.systems.cell.text import printed
from bus_sim.systems.cell.tree import ALL_FILTERS, ContractTree
from onboard.systems.cell.contracts import Contract, Filter, filtered
from onboard.systems.cell.geometry import Area, Point
from onboard.systems.cell.offers import OFFERS, OfferRule, closest_in_x, closest_in_y, equal_steps
from tests.cell.witness import ARMS, GOAL, HOMES, metres


def _tree(rules: tuple[OfferRule, ...] = OFFERS, filters: frozenset[Filter] = ALL_FILTERS) -> ContractTree:
    return ContractTree(ARMS, HOMES, filters=filters, rules=rules)


def _printed(tree: ContractTree, contract: Contract) -> str:
    homes = {one.node_id: one for one in ARMS}
    steps = [
        (homes[step.node].name, homes[step.node].home, step.goal.start, step.move.via, step.own_cost)
        for step in tree.steps(contract)
    ]
    return printed(steps, contract.cost)


def test_c08_c21_c24_the_printed_run_to_the_last_digit() -> None:
    tree = _tree()
    contract = tree.solve(GOAL)
    assert contract is not None
    assert f"{contract.cost:.13f}" == "65.2119063886405"
    assert contract.nodes == (1, 2, 3)
    golden = Path(__file__).with_name("printed_run.txt").read_text(encoding="utf-8")
    assert _printed(tree, contract) == golden


def test_c09_the_three_offers_of_the_first_robot() -> None:
    area = ARMS[0].area
    assert [rule(area, GOAL.start, GOAL.end) for rule in OFFERS] == [metres(16, 16), metres(22, 10), metres(10, 16)]
    # The second robot's via point of the printed run is its offer 1.
    assert equal_steps(ARMS[1].area, metres(22, 10), GOAL.end) == metres(30, 18)
    # An axis that has come to the goal's coordinate does not stop the other.
    assert equal_steps(area, metres(10, 5), metres(12, 30)) == metres(12, 16)


@pytest.mark.parametrize(
    ("rule", "cost"),
    [(equal_steps, None), (closest_in_x, 65.2119063886405), (closest_in_y, 72.4420750269)],
)
def test_c10_what_each_offer_of_the_first_robot_leads_to(rule: OfferRule, cost: float | None) -> None:
    tree = _tree()
    tree.solve(GOAL)
    (root,) = tree.levels[0]
    via = rule(root.arm.area, GOAL.start, GOAL.end)
    answers = next(answers for move, answers in root.offers if move.via == via)
    costs = [answer.contract.cost for answer in answers if answer.contract is not None]
    own = next(move.cost(root.arm) for move, _ in root.offers if move.via == via)
    if cost is None:
        assert not costs
    else:
        assert own + min(costs) == pytest.approx(cost, abs=1e-10)


def test_c10_c19_offer_1_alone_gives_no_solution() -> None:
    assert _tree((equal_steps,)).solve(GOAL) is None
    assert printed([], 0.0) == "The goal can not be achieved\n"


def test_c12_c13_goal_messages_fall_from_filter_to_filter() -> None:
    counts = []
    for filters in (frozenset[Filter](), frozenset({Filter.PREDECESSOR}), ALL_FILTERS):
        tree = _tree(filters=filters)
        contract = tree.solve(GOAL)
        assert contract is not None and f"{contract.cost:.13f}" == "65.2119063886405"
        counts.append(tree.messages)
    assert counts == [97, 50, 8]
    sub_goal = GOAL.part_of(1, 1, metres(22, 10))
    assert [filtered(sub_goal, one) for one in ARMS[:2]] == [Filter.PREDECESSOR, None]


def test_c11_the_tree_is_four_levels_deep_and_built_from_the_deepest() -> None:
    tree = _tree()
    tree.solve(GOAL)
    names = [[node.arm.name for node in level] for level in tree.levels]
    assert names == [["R1"], ["R4", "R2", "R4"], ["R3", "R5"], ["R3", "R3"], []]
    (root,) = tree.levels[0]
    assert root.contract is not None and root.contract.nodes == (1, 2, 3)
    assert all(node.goal.level == level for level, nodes in enumerate(tree.levels) for node in nodes)


def _on_the_straight_line(area: Area, start: Point, end: Point) -> Point:
    """The last point of the straight line to the goal that the area holds: a reading that the paper's run refutes."""
    share = Fraction(1)
    for here, there, low, high in (
        (start.x_mm, end.x_mm, area.x0_mm, area.x1_mm),
        (start.y_mm, end.y_mm, area.y0_mm, area.y1_mm),
    ):
        if here != there:
            share = min(share, Fraction((high if there > here else low) - here, there - here))
    return Point(*(round(here + share * (there - here)) for here, there in zip(start, end, strict=True)))


def _nearest_to_the_goal(area: Area, start: Point, end: Point) -> Point:
    """The area's point nearest to the goal, its corner in this geometry: another reading that the run refutes."""
    return Point(closest_in_x(area, start, end).x_mm, closest_in_y(area, start, end).y_mm)


def test_c09_other_readings_of_maximum_displacement_give_other_runs() -> None:
    assert _tree((_on_the_straight_line, closest_in_x, closest_in_y)).solve(GOAL) is None
    contract = _tree((_nearest_to_the_goal, closest_in_x, closest_in_y)).solve(GOAL)
    assert contract is not None and contract.cost == pytest.approx(71.5296624429, abs=1e-10)

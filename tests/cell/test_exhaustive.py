"""The tree of contracts against an exhaustive search that shares no code with it, on geometries drawn by seed."""

from itertools import permutations
from math import sqrt
from random import Random

import pytest

from bus_sim.systems.cell.tree import ContractTree
from onboard.contract.messages import Reference
from onboard.systems.cell.contracts import Arm, Filter, Goal
from onboard.systems.cell.geometry import Area, Point, crosses, shortest_way, way_length_m


def _cheapest(arms: tuple[Arm, ...], goal: Goal) -> float | None:
    """Every order of every set of robots, every offer of each: the cheapest chain from start to end."""
    found: list[float] = []
    for length in range(1, len(arms) + 1):
        for chain in permutations(arms, length):
            found += _chains(chain, goal.start.x_mm, goal.start.y_mm, goal.end, 0.0)
    return min(found, default=None)


def _chains(chain: tuple[Arm, ...], x: int, y: int, end: Point, so_far: float) -> list[float]:
    arm, (x0, y0, x1, y1) = chain[0], chain[0].area
    if not (x0 <= x <= x1 and y0 <= y <= y1):
        return []
    here = so_far + arm.unit_cost * sqrt((x - arm.home.x_mm) ** 2 + (y - arm.home.y_mm) ** 2) / 1000
    if x0 <= end.x_mm <= x1 and y0 <= end.y_mm <= y1:
        return (
            [here + arm.unit_cost * sqrt((x - end.x_mm) ** 2 + (y - end.y_mm) ** 2) / 1000] if len(chain) == 1 else []
        )
    if len(chain) == 1:
        return []
    found: list[float] = []
    for to_x, to_y in {_diagonal(arm.area, x, y, end), (_into(end.x_mm, x0, x1), y), (x, _into(end.y_mm, y0, y1))}:
        if (to_x, to_y) != (x, y):
            cost = here + arm.unit_cost * sqrt((x - to_x) ** 2 + (y - to_y) ** 2) / 1000
            found += _chains(chain[1:], to_x, to_y, end, cost)
    return found


def _into(value: int, low: int, high: int) -> int:
    return low if value < low else high if value > high else value


def _diagonal(area: tuple[int, int, int, int], x: int, y: int, end: Point) -> tuple[int, int]:
    """Step by step of one metre, as a person would do it on squared paper (all coordinates are whole metres)."""
    x0, y0, x1, y1 = area
    while (x, y) != end:
        to_x = x + 1000 * ((end.x_mm > x) - (end.x_mm < x))
        to_y = y + 1000 * ((end.y_mm > y) - (end.y_mm < y))
        if not (x0 <= to_x <= x1 and y0 <= to_y <= y1):
            break
        x, y = to_x, to_y
    return x, y


def _cell(random: Random) -> tuple[tuple[Arm, ...], Goal]:
    """Four robots whose areas mostly touch or overlap, unit costs 0.5 to 2, start and end in some areas."""
    arms = []
    for node in range(1, 5):
        x0, y0 = 1000 * random.randint(0, 14), 1000 * random.randint(0, 14)
        area = Area(x0, y0, x0 + 1000 * random.randint(6, 14), y0 + 1000 * random.randint(6, 14))
        arms.append(Arm(node, f"R{node}", area, _inside(random, area), random.choice((0.5, 1.0, 1.5, 2.0))))
    start, end = _inside(random, arms[0].area), _inside(random, random.choice(arms[1:]).area)
    return tuple(arms), Goal(Reference(9, 1), Reference(9, 1), start, end)


def _inside(random: Random, area: Area) -> Point:
    x = random.randint(area.x0_mm // 1000, area.x1_mm // 1000)
    return Point(1000 * x, 1000 * random.randint(area.y0_mm // 1000, area.y1_mm // 1000))


@pytest.mark.parametrize("seed", range(6))
def test_c06_c20_no_cheaper_chain_of_robots_exists(seed: int) -> None:
    random = Random(seed)
    solved = 0
    for _ in range(40):
        arms, goal = _cell(random)
        homes = {one.node_id: one.home for one in arms}
        contract = ContractTree(arms, homes).solve(goal)
        expected = _cheapest(arms, goal)
        assert (contract is None) == (expected is None)
        if contract is not None and expected is not None:
            solved += 1
            assert contract.cost == pytest.approx(expected, abs=1e-9)
            # What the robots do by themselves adds up to what was promised (row C08).
            tree = ContractTree(arms, homes)
            again = tree.solve(goal)
            assert again is not None
            assert sum(step.own_cost for step in tree.steps(again)) == pytest.approx(contract.cost, abs=1e-9)
    assert solved > 10


@pytest.mark.parametrize("seed", range(3))
def test_c13_the_filter_by_the_start_loses_nothing(seed: int) -> None:
    random = Random(100 + seed)
    for _ in range(20):
        arms, goal = _cell(random)
        homes = {one.node_id: one.home for one in arms}
        without = ContractTree(arms, homes, filters=frozenset({Filter.PREDECESSOR}))
        with_it = ContractTree(arms, homes)
        one, other = without.solve(goal), with_it.solve(goal)
        assert (one.cost if one is not None else None) == (other.cost if other is not None else None)
        assert with_it.messages <= without.messages


def test_c12_a_part_that_comes_back_is_not_found() -> None:
    """The paper's proviso: without circular paths. Here the only chain is R1, R2, R1, R4 (found by drawing cells)."""
    arms, goal = _cell(Random(229))
    homes = {one.node_id: one.home for one in arms}
    round_about = ContractTree(arms, homes, filters=frozenset()).solve(goal)
    assert round_about is not None and round_about.nodes == (1, 2, 1, 4)
    assert ContractTree(arms, homes).solve(goal) is None


def test_c20_goal_messages_stay_below_the_bound() -> None:
    random = Random(7)
    for _ in range(40):
        arms, goal = _cell(random)
        tree = ContractTree(arms, {one.node_id: one.home for one in arms}, filters=frozenset({Filter.PREDECESSOR}))
        tree.solve(goal)
        bound, product = 0, 1
        for level in range(len(arms)):
            product *= (len(arms) - level) * (3 if level else 1)
            bound += product
        assert tree.messages <= bound


def test_c01_ways_go_round_obstacles_within_the_area() -> None:
    area, machine_tool = Area(0, 0, 10_000, 10_000), Area(4000, 2000, 6000, 10_000)
    one, other = Point(2000, 5000), Point(8000, 5000)
    assert crosses(one, other, machine_tool)
    # Along a border is free, and so is a corner.
    assert not crosses(Point(0, 2000), Point(10_000, 2000), machine_tool)
    assert not crosses(Point(2000, 4000), Point(6000, 0), machine_tool)
    way = shortest_way(one, other, area, (machine_tool,))
    assert way == (one, Point(4000, 2000), Point(6000, 2000), other)
    assert way_length_m(way) == pytest.approx(2 * sqrt(13) + 2)
    # The way round on the other side is longer or, as here, closed by the area's border.
    assert shortest_way(one, other, Area(0, 3000, 10_000, 9000), (machine_tool,)) is None
    assert shortest_way(one, Point(5000, 5000), area, (machine_tool,)) is None

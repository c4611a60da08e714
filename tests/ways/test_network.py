"""The one network: least costs, cheapest ways, what is reached, and rests; against trying everything."""

import random
from itertools import permutations

from onboard.ways.network import Network
from onboard.ways.rests import Rest, cut_off, lasting_rests


def drawn(seed: int, places: int = 7) -> Network[int]:
    """Some places with ways of chance, one way or both."""
    chance = random.Random(f"network:{seed}")
    ends = [pair for pair in permutations(range(places), 2) if chance.random() < 0.3]
    return Network({one: [(to, chance.randint(1, 4)) for start, to in ends if start == one] for one in range(places)})


def all_ways(network: Network[int], start: int, goal: int) -> list[tuple[int, tuple[int, ...]]]:
    """Every way without a circle, with what it costs."""
    found: list[tuple[int, tuple[int, ...]]] = []
    ahead: list[tuple[int, tuple[int, ...]]] = [(0, (start,))]
    while ahead:
        cost, way = ahead.pop()
        if way[-1] == goal:
            found.append((cost, way))
            continue
        ahead += [(cost + more, (*way, to)) for to, more in network.ways[way[-1]] if to not in way]
    return found


def test_costs_and_ways_are_the_least_of_all_and_ties_go_to_the_lowest_places() -> None:
    for seed in range(20):
        network = drawn(seed)
        for goal in range(7):
            costs = network.costs_to((goal,))
            for start in range(7):
                every = all_ways(network, start, goal)
                assert costs.get(start) == min((cost for cost, _ in every), default=None)
                assert network.way(start, costs) == (min(every)[1] if every else None)


def test_what_costs_more_is_gone_round_where_that_pays() -> None:
    for seed in range(20):
        network, more = drawn(seed), {2: 3, 4: 1}
        costs = network.costs_to((6,))
        every = [(cost + sum(more.get(one, 0) for one in way[1:]), way) for cost, way in all_ways(network, 0, 6)]
        assert network.way(0, costs, more) == (min(every)[1] if every else None)


def test_goals_may_cost_something_themselves() -> None:
    line = Network({0: [(1, 2)], 1: [(0, 2), (2, 2)], 2: [(1, 2)]})
    assert line.costs_to({0: 5, 2: 0}) == {2: 0, 1: 2, 0: 4}


def test_the_ground_is_where_one_comes_to_and_fro_without_what_is_closed() -> None:
    network = Network({0: [(1, 1)], 1: [(0, 1), (2, 1)], 2: [(3, 1)], 3: [(1, 1)], 4: [(0, 1)]})
    assert network.ground((0,)) == {0, 1, 2, 3}
    assert network.ground((0,), closed={3}) == {0, 1}
    assert network.to_any((0,)) == {0, 1, 2, 3, 4}


def reaches(network: Network[int], start: int, goal: int, closed: set[int]) -> bool:
    """Whether a way without a circle passes nothing that is closed."""
    return any(not closed & set(way[1:-1]) for _, way in all_ways(network, start, goal))


def test_rests_that_last_let_everybody_else_come_everywhere() -> None:
    kept = 0
    for seed in range(40):
        network = drawn(seed)
        goals = [0, 1]
        rests = lasting_rests(network, [2, 3, 4, 5, 6], goals)
        kept += len(rests)
        needed = [*goals, *rests] if rests else []
        for start, goal in permutations(needed, 2):
            assert reaches(network, start, goal, {*rests} - {start, goal}), (seed, start, goal)
    assert kept > 10


def test_one_place_is_asked_about_as_many_are() -> None:
    for seed in range(40):
        network = drawn(seed)
        one = [Rest((place,), frozenset((place,))) for place in (3, 5)]
        many = [Rest((place,), frozenset((place,)), frozenset((place,))) for place in (3, 5)]
        assert cut_off(network, (0,), one, (1, 2)) == cut_off(network, (0,), many, (1, 2)), seed


def test_where_standing_takes_what_another_place_takes_nobody_rests() -> None:
    star = Network({0: [(1, 1), (2, 1), (3, 1)], 1: [(0, 1)], 2: [(0, 1)], 3: [(0, 1)]}, {0: 0, 1: 1, 2: 2, 3: 2})
    assert lasting_rests(star, [1, 2, 3], (0,)) == {1}

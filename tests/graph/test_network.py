"""Rows G01, G03, G09, G12: the graph and shortest ways on it without reversing."""

import random

from onboard.systems.graph.network import NOWHERE, Graph, edge, grid, ring
from tests.graph.brute_force import least


def test_g01_lengths_decide_between_ways() -> None:
    graph = Graph({(0, 1): 5, (1, 2): 5, (0, 3): 2, (2, 3): 7, (1, 3): 2})
    assert graph.way(NOWHERE, 0, 1) == (0, 3, 1)
    assert graph.distance_mm(NOWHERE, 0, 2) == 9
    assert graph.neighbours[3] == (0, 1, 2)


def test_g09_a_robot_goes_round_rather_than_back() -> None:
    graph = ring(6)
    assert graph.way(NOWHERE, 2, 0) == (2, 1, 0)
    assert graph.way(1, 2, 0) == (2, 3, 4, 5, 0)
    assert Graph({(0, 1): 1, (1, 2): 1}).way(1, 2, 0) is None


def test_g12_shortest_ways_are_what_trying_all_ways_gives() -> None:
    chance = random.Random(12)
    for _ in range(4):
        lengths = {one: chance.randint(1, 9) for one in grid(2, 4).lengths_mm}
        lengths[edge(0, 7)] = chance.randint(1, 9)
        graph = Graph(lengths)
        for came_from in graph.nodes:
            for node in graph.neighbours[came_from]:
                for goal in graph.nodes:
                    assert graph.distance_mm(came_from, node, goal) == least(lengths, came_from, node, goal, 40)

"""Makespan on the bus over the exact optimum, and the optimum itself."""

from bus_sim.sites import find_site
from bus_sim.systems.graph.against_optimum import compare
from bus_sim.systems.graph.certify.optimum import least_steps, some_tasks
from bus_sim.systems.graph.certify.search import TaskSet
from onboard.systems.graph.network import complete, grid, ring
from onboard.systems.graph.site import FactoryGraph


def test_the_optimum_of_cases_that_can_be_seen() -> None:
    assert least_steps(ring(6), TaskSet((0,), (3,))) == 3
    # Two that come towards each other on one edge pass it one after the other, or one goes round.
    assert least_steps(ring(4), TaskSet((0, 1), (1, 0))) == 2
    assert least_steps(complete(4), TaskSet((0, 1), (1, 0))) == 2
    assert least_steps(grid(3, 3), TaskSet((3, 5), (5, 3))) == 2


def test_two_robots_are_close_to_the_optimum() -> None:
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    found = compare(site, grid(3, 3, 6000), 2, 3)
    assert all(1 - 1e-6 <= one < 1.5 for one in found.ratios)
    assert len(set(some_tasks(grid(3, 3), 2, 3, 1))) == 3

"""P56: the bounds are bounds, whatever order a bay takes its customers in, and near what a bay can do."""

import asyncio
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import permutations

import pytest

from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.bounds.bay_order import BayJob, least_ends_us
from bus_sim.systems.car_park.bounds.free_flow import FreeFlow, LeastWays
from bus_sim.systems.car_park.bounds.visits import FROM_ROBOT, BayVisit, VisitLog
from bus_sim.systems.car_park.bounds.waiting import WaitBounds, bays_alone_us, free_flow_us
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site
from onboard.ways.site import Axis, WaySite, way_site
from tests.sites import at_arrival, at_the_key, one_floor

HOUR_US = 3_600_000_000


def ends(order: Sequence[BayJob], turn: int) -> int:
    """The sum of ends of one order, each as soon as it can be."""
    end, total, before = 0, 0, None
    for job in order:
        turned = turn if before is job.goes_out else 0
        end = max(job.release_us, end + turned if before is not None else 0) + job.busy_us
        before, total = job.goes_out, total + end
    return total


def drawn(chance: random.Random, turn: int) -> list[BayJob]:
    span = chance.choice((10, 60, 200))
    return [
        BayJob(chance.randint(0, span), chance.randint(turn + 1, 40), chance.random() < 0.5)
        for _ in range(chance.randint(1, 6))
    ]


def test_no_order_of_drawn_jobs_is_below_the_bound() -> None:
    chance, reached = random.Random(1), 0
    for _ in range(150):
        turn = chance.choice((0, 3, 6))
        jobs = drawn(chance, turn)
        best = min(ends(order, turn) for order in permutations(jobs))
        assert least_ends_us(jobs, turn, most_steps=0) <= least_ends_us(jobs, turn) <= best
        reached += least_ends_us(jobs, turn) == best
    # A bay that waits for somebody though another is there is looked at as one that does not.
    assert reached >= 145


def test_two_of_one_direction_have_a_turn_between_them() -> None:
    comes, goes = BayJob(0, 50, goes_out=False), BayJob(0, 40, goes_out=True)
    assert least_ends_us([comes, comes], 6) == 50 + 106
    assert least_ends_us([comes, goes], 6) == 40 + 90
    assert least_ends_us([goes, goes, comes], 6) == 40 + 90 + 130


def ran(site: WaySite, demand: Demand, seed: int) -> list[BayVisit]:
    """What happened at the bays until nobody waited."""
    loop = VirtualTimeLoop()

    async def run() -> list[BayVisit]:
        simulation = build(site, RunOptions(seed=seed), loop)
        log = VisitLog(simulation.plant, seed)
        simulation.plant.street.add_all(demand, 10_000_000)
        simulation.start()
        await run_until(simulation, lambda: simulation.plant.is_over, HOUR_US, 1_000_000)
        for controller in simulation.controllers.values():
            await controller.stop()
        assert simulation.plant.oracle.finish() == []
        return log.visits(lambda _: True)

    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(run())
    finally:
        asyncio.set_event_loop(None)
        loop.close()


@pytest.mark.parametrize("calls", [at_the_key, at_arrival])
def test_p56_nobody_waits_less_than_alone_in_an_empty_park(calls: Callable[[Site], Site]) -> None:
    site = way_site(calls(find_site("small")))
    visits = ran(site, Demand.by_mean(40, 20, 2, count=5), 2)
    assert len(visits) == 10
    least_us = free_flow_us(FreeFlow.of(site), LeastWays(site), visits)
    assert all(least <= visit.waited_us for least, visit in zip(least_us, visits, strict=True))
    assert bays_alone_us(FreeFlow.of(site), visits) <= sum(visit.waited_us for visit in visits)


def test_p56_the_free_flow_bound_is_no_looser_than_a_lone_robots_way() -> None:
    """One car in an empty park: in, nothing but frames; out, a robot that stands a few segments away."""
    site = one_floor()
    comes, goes = ran(site, Demand.one_car(stay_s=600, seed=3), 3)
    least_us = free_flow_us(FreeFlow.of(site), LeastWays(site), [comes, goes])
    assert 0 <= comes.waited_us - least_us[0] < 20_000
    assert 0 <= goes.waited_us - least_us[1] < 10_000_000


def test_bays_alone_is_what_a_park_with_hardly_any_way_comes_near_to() -> None:
    """Cars come faster than the bay takes them, to one robot on a short alley that drives at 6 m/s."""
    site = replace(one_floor(), carrier=Axis(6_000, 6_000))
    stays = tuple(replace(stay, departure_us=None) for stay in Demand.by_mean(10, 5, 1, count=5).stays)
    bounds = WaitBounds.of(site, ran(site, Demand(stays), 1))
    assert bounds.visits == 5
    assert 1 <= bounds.to_bays_alone < 1.1
    assert bounds.to_free_flow > 2


def test_who_asks_while_the_car_is_carried_waits_for_no_more_than_it_took() -> None:
    """Whose stay is over before the ticket is there asks at once: the car is in the bay, and still it is parked."""
    stays = tuple(replace(stay, departure_us=stay.arrival_us + 1) for stay in Demand.by_mean(60, 20, 1, count=2).stays)
    site = one_floor()
    visits = ran(site, Demand(stays), 1)
    assert [visit.strokes for visit in visits] == [FROM_ROBOT] * 4
    assert WaitBounds.of(site, visits).to_bays_alone >= 1

"""A whole day without frames: nobody meets, every task is done by somebody, and sooner than by Token Passing."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import pytest

import bus_sim
from bus_sim.systems.mapd.importers.command import import_files
from bus_sim.systems.mapd.importers.draft import site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand
from bus_sim.systems.mapd.published import TOKEN_PASSING
from bus_sim.systems.mapd.steps import SteppedDay
from onboard.config.site import parse_site
from onboard.core.serial import to_bus_ms
from onboard.systems.mapd.auction import Availability, Backlog, BidWeights, cost, winners
from onboard.systems.mapd.calls import call_of
from onboard.systems.mapd.floor import grid_floor
from onboard.systems.mapd.knowledge import Knowledge
from onboard.systems.mapd.nearby import Nearby
from onboard.systems.mapd.site import Mapd
from onboard.systems.mapd.tasks import TransportTask

DATA = Path(bus_sim.__file__).parent / "data" / "mapd"


def kiva(robots: int, rate: str) -> Mapd:
    draft = import_files([DATA / f"kiva-{robots}-500-5.map", DATA / f"kiva-{rate}.task"], DrawnDemand())
    site = parse_site(site_text(draft), "kiva.toml")
    assert isinstance(site, Mapd)
    return site


def played(site: Mapd, tasks: Sequence[TransportTask] | None = None) -> SteppedDay:
    homes = list(site.homes.values())
    tasks = site.tasks if tasks is None else tasks
    return SteppedDay(site.floor, homes, site.rests, tasks, ends=site.endpoints).run()


def judge(site: Mapd, day: SteppedDay, tasks: Sequence[TransportTask]) -> None:
    """From where the robots stood alone."""
    width = len(site.rows[0])
    for step, (before, now) in enumerate(pairwise(day.history), start=1):
        assert len(set(now)) == len(now), f"two in one cell at step {step}"
        moves = {(was, cell) for was, cell in zip(before, now, strict=True) if was != cell}
        assert not {(cell, was) for was, cell in moves} & moves, f"a swap at step {step}"
        for was, cell in moves:
            assert abs(cell - was) == width or (abs(cell - was) == 1 and cell // width == was // width)
            assert site.rows[cell // width][cell % width] != "@"
    for task in tasks:
        served = day.served[task.number]
        robot = day.history[served].index(task.delivery)
        assert any(day.history[step][robot] == task.pickup for step in range(task.release, served + 1)), task


@pytest.mark.parametrize(("robots", "rate"), [(10, "0.5"), (30, "10")])
def test_p59_a_whole_file_is_served_sooner_than_by_token_passing(robots: int, rate: str) -> None:
    site = kiva(robots, rate)
    day = played(site)
    assert len(day.served) == 500
    assert day.service_time <= TOKEN_PASSING[rate, robots]
    judge(site, day, site.tasks)


def test_thirty_robots_serve_a_trickle_of_tasks() -> None:
    site = kiva(30, "2")
    tasks = site.tasks[:60]
    day = played(site, tasks)
    judge(site, day, tasks)


def test_the_lowest_bid_of_all_wins_first_and_its_robot_falls_silent() -> None:
    floor = grid_floor(["........"])
    tasks = [TransportTask(1, 0, 3, 4), TransportTask(2, 0, 6, 7)]
    won = winners(Nearby(floor), BidWeights(), [Availability(11, 0, 0), Availability(12, 4, 0)], tasks, 0)
    assert {robot: task.number for robot, (task, _) in won.items()} == {12: 1, 11: 2}


def test_short_work_comes_before_long_work_equally_far() -> None:
    floor = grid_floor(["........."])
    near, far = TransportTask(1, 0, 3, 8), TransportTask(2, 0, 5, 4)
    offer = Availability(11, 4, 0)
    assert cost(floor, BidWeights(), offer, far) == 150
    assert cost(floor, BidWeights(), offer, near) == 350


def test_who_still_carries_bids_from_where_and_when_it_will_be_free() -> None:
    floor = grid_floor(["........."])
    assert cost(floor, BidWeights(), Availability(11, 4, 6), TransportTask(1, 0, 5, 4)) == 750


def test_no_task_waits_for_ever_behind_new_ones_that_are_nearer() -> None:
    floor = grid_floor(["." * 30])

    def chosen(later: int) -> int:
        tasks = [TransportTask(1, 5, 29, 0), TransportTask(2, 5 + later, 1, 2)]
        return winners(Nearby(floor), BidWeights(), [Availability(11, 0, 0)], tasks, 5 + later)[11][0].number

    assert chosen(0) == 2
    # 28 steps more to the pick-up and 28 more with the load, at 100 and 27, less 5 at 55 as the old one ends beside the
    # other, against 20 for each step: half of it, as there are two tasks for one robot.
    assert (chosen(328), chosen(329)) == (2, 1)


@pytest.mark.parametrize(("tasks", "robots", "later"), [(1, 1, 200), (10, 10, 200), (2, 10, 200), (40, 10, 50)])
def test_age_counts_less_where_many_would_wait_for_an_old_task(tasks: int, robots: int, later: int) -> None:
    floor, offer = grid_floor(["........."]), Availability(11, 4, 0)
    old, young = TransportTask(1, 3, 5, 4), TransportTask(2, 13, 5, 4)
    backlog = Backlog(3, tasks, robots)
    # One step to the pick-up and one with the load.
    least = 127 if tasks == 40 else 150
    assert cost(floor, BidWeights(), offer, old, backlog) == least
    assert cost(floor, BidWeights(), offer, young, backlog) == least + later


def known_calls(*calls: tuple[int, int]) -> Knowledge:
    """What a robot knows of these calls, by task and deadline in us."""
    known = Knowledge(grid_floor(["." * 8]), (11,), 11, step_ms=500)
    for number, until_us in calls:
        known.on_call(call_of(1, TransportTask(number, 0, 3, 5), until_us))
    return known


def test_a_task_is_as_old_as_the_step_in_whose_round_it_was_called_for() -> None:
    known = known_calls((4, 2_400_000), (9, 2_400_000))
    known.on_round(7, to_bus_ms(2_410_000))
    # The step between was a long one, and a call that is told again is no news.
    for number, until_us in ((4, 2_400_000), (5, 9_400_000)):
        known.on_call(call_of(1, TransportTask(number, 0, 3, 5), until_us))
    known.on_round(8, to_bus_ms(9_410_000))
    assert {number: task.release for number, task in known.tasks.items()} == {4: 7, 9: 7, 5: 8}


def test_who_was_started_again_reads_from_deadlines_how_old_tasks_are() -> None:
    known = known_calls((4, 2_400_000), (9, 12_400_000), (2, 1_400_000))
    known.on_round(100, to_bus_ms(22_410_000))
    assert {number: task.release for number, task in known.tasks.items()} == {4: 60, 9: 80, 2: 58}


def test_a_task_that_nobody_can_reach_gets_no_bid() -> None:
    floor = grid_floor(["..@.."])
    assert cost(floor, BidWeights(), Availability(11, 0, 0), TransportTask(1, 0, 3, 4)) is None

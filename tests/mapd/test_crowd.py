"""What a bid says where much is open, and at last: which tasks lead on to others, and which are begun first."""

import random
from itertools import pairwise

import pytest

from onboard.systems.mapd.auction import QUIET_STEPS, Availability, Backlog, BidWeights, bids, winners
from onboard.systems.mapd.floor import Floor, grid_floor
from onboard.systems.mapd.nearby import ENDS, RANGE, Nearby
from onboard.systems.mapd.tasks import TransportTask
from onboard.ways.steps import FAR

FLOOR = grid_floor(["............", ".@@@.@@@.@@.", "............", ".@@@.@@@.@@.", "............"])
#: Cells of a ring of one-way lanes: the way there is not the way back.
ONE_WAY = Floor(tuple(map(str, range(9))), tuple(((cell + 1) % 9,) for cell in range(9)), tuple(range(9)))


def drawn(chance: random.Random, floor: Floor, count: int, first: int = 1) -> list[TransportTask]:
    """So many tasks between different cells of the floor."""
    free = [cell for cell, ways in enumerate(floor.ways) if ways]
    pairs = [chance.sample(free, 2) for _ in range(count)]
    return [TransportTask(first + number, 0, *pair) for number, pair in enumerate(pairs)]


@pytest.mark.parametrize("floor", [FLOOR, ONE_WAY])
def test_what_lies_near_a_task_is_that_of_the_open_tasks_however_they_came_and_went(floor: Floor) -> None:
    chance, nearby = random.Random(7), Nearby(floor)
    tasks = drawn(chance, floor, 12)
    for came in range(6):
        tasks = chance.sample(tasks, 9) + drawn(chance, floor, 4, 100 * (came + 1))
        nearby.see(tasks)
        for task in tasks:
            others = [one for one in tasks if one is not task]
            ahead = [floor.steps_to(one.pickup)[task.delivery] for one in others]
            behind = sorted(floor.steps_to(task.pickup)[one.delivery] for one in others)
            assert nearby.onward(task) == min(RANGE, *ahead)
            assert nearby.reached(task) == min(RANGE, behind[ENDS - 1])


def test_where_much_is_open_the_task_that_leads_on_to_another_goes_first() -> None:
    floor = grid_floor(["." * 41])
    # Both ways with a load are as long; one ends where the third begins.
    on, off, third = TransportTask(2, 0, 22, 32), TransportTask(1, 0, 18, 8), TransportTask(3, 0, 33, 40)

    def chosen(robots: int) -> int:
        offers = [Availability(11 + robot, 20, robot * 1_000) for robot in range(robots)]
        return winners(Nearby(floor), BidWeights(), offers, [on, off, third], 0)[11][0].number

    # With a robot for each task nobody goes on from one to another.
    assert (chosen(1), chosen(3)) == (2, 1)


@pytest.mark.parametrize(("quiet", "first"), [(QUIET_STEPS - 1, 1), (QUIET_STEPS, 2)])
def test_of_the_last_tasks_the_longest_is_begun_first(quiet: int, first: int) -> None:
    floor = grid_floor(["." * 30])
    tasks = [TransportTask(1, 40, 3, 5), TransportTask(2, 40, 4, 29)]
    offers = [Availability(11, 0, 0), Availability(12, 0, 60), Availability(13, 0, 90)]
    assert winners(Nearby(floor), BidWeights(), offers, tasks, 40 + quiet)[11][0].number == first


def test_no_bid_is_below_the_least_that_others_take_for_possible() -> None:
    chance, rule, nearby, here = random.Random(3), BidWeights(), Nearby(FLOOR), 0
    for count, robots, step in ((1, 9, 90), (3, 2, 5), (3, 9, 90), (30, 2, 5), (30, 2, 90)):
        tasks = drawn(chance, FLOOR, count)
        nearby.see(tasks)
        backlog = Backlog.of(nearby, tasks, robots, step)
        # Whether it has nothing, or carries something to where one of the tasks begins.
        for free_in in {here, *(task.pickup for task in tasks)}:
            offer = Availability(11, free_in, FLOOR.steps_to(free_in)[here])
            for task, (bid, number) in zip(tasks, bids(FLOOR, rule, offer, tasks, backlog), strict=True):
                empty, loaded = FLOOR.steps_to(task.pickup)[here], FLOOR.steps_to(task.delivery)[task.pickup]
                assert number == task.number and empty < FAR
                least = rule.least_weights()
                assert bid >= least[0] * empty + least[1] * loaded


def test_once_no_more_come_age_counts_less() -> None:
    floor, offer = grid_floor(["." * 9]), Availability(11, 4, 0)
    tasks = [TransportTask(1, 0, 5, 4), TransportTask(2, 10, 5, 4)]
    for step, later in ((10 + QUIET_STEPS - 1, 200), (10 + QUIET_STEPS, 150)):
        backlog = Backlog.of(Nearby(floor), tasks, 2, step)
        (old, _), (young, _) = bids(floor, BidWeights(), offer, tasks, backlog)
        assert young - old == later


def test_until_there_are_two_tasks_a_robot_the_ways_count_less_by_and_by() -> None:
    crowds = [Backlog(0, tasks, 10).crowd for tasks in (1, 10, 15, 20, 40)]
    assert crowds == [0, 0, 50, 100, 100]
    floor, task = grid_floor(["." * 30]), TransportTask(1, 0, 3, 23)
    offer, backlogs = Availability(11, 0, 8), [Backlog(0, count, 10) for count in (10, 15, 20, 40)]
    costs = [bids(floor, BidWeights(), offer, [task], backlog)[0][0] for backlog in backlogs]
    assert costs[0] == 8 * 100 + 3 * 100 + 20 * 50 and all(later < sooner for sooner, later in pairwise(costs))
    assert costs[-1] == 8 * 50 + 3 * 100 + 20 * 27

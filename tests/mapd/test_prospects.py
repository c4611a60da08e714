"""What is worked out once for all robots of a process is what each would have worked out by itself."""

import random

import pytest

from onboard.systems.mapd.auction import Availability, Backlog, BidWeights, bids
from onboard.systems.mapd.floor import grid_floor
from onboard.systems.mapd.nearby import Nearby
from onboard.systems.mapd.prospects import SPAN, BidList, Prospects
from onboard.systems.mapd.tasks import TransportTask, task_named

FLOOR = grid_floor(["." * 24] * 12)
ROBOTS = 6


def by_itself(rule: BidWeights, offer: Availability, tasks: list[TransportTask], step: int) -> list[tuple[int, int]]:
    """The bids of a robot that knows nobody's else and looks at the open tasks for the first time."""
    nearby = Nearby(FLOOR)
    nearby.see(tasks)
    return bids(FLOOR, rule, offer, tasks, Backlog.of(nearby, tasks, ROBOTS, step))


def looked_at(offers: BidList) -> list[tuple[int, int]]:
    """All bids, as far as one looks."""
    found: list[tuple[int, int]] = []
    while some := offers.look_on():
        assert some[-1][0] <= some[0][0] + SPAN
        found += some
    return found


def test_what_is_not_open_and_what_cannot_be_reached_has_no_bid() -> None:
    split = grid_floor(["...@..."])
    near, far = task_named(1, 0, 0, 2), task_named(2, 0, 4, 6)
    offers = Prospects(split, ROBOTS).offers(BidWeights(), Availability(11, 1, 0), [near, far], 0)
    assert (offers.bid(2), offers.bid(3)) == (None, None)
    assert looked_at(offers) == [(offers.bid(1), 1)]
    assert offers.look_on() == []


@pytest.mark.parametrize("seed", range(4))
def test_robots_that_know_different_tasks_bid_as_if_alone(seed: int) -> None:
    """In turn, from one step to the next: tasks come, go, are known better, and begin elsewhere after a restart."""
    chance, prospects = random.Random(seed), Prospects(FLOOR, ROBOTS)
    cells = range(FLOOR.size)
    known = {number: task_named(number, 0, *chance.sample(cells, 2)) for number in range(24)}
    for step in range(40):
        for number in chance.sample(sorted(known), min(1, len(known))):
            del known[number]
        for number in chance.sample(sorted(known), min(2, len(known))):
            task = known[number]
            ends = (task.pickup, task.delivery) if chance.random() < 0.5 else chance.sample(cells, 2)
            known[number] = task_named(number, step, *ends)
        if step < 25:
            known[100 + step] = task_named(100 + step, step, *chance.sample(cells, 2))
        both = [known[number] for number in sorted(known)]
        late = both[: len(both) // 2]
        for rule in (BidWeights(), BidWeights(nearby=0)):
            for tasks in (both, late, both):
                offer = Availability(11, chance.choice(cells), chance.randrange(4))
                alone, offers = by_itself(rule, offer, tasks, step), prospects.offers(rule, offer, tasks, step)
                assert [(offers.bid(number), number) for _, number in alone] == alone
                assert looked_at(offers) == sorted(alone), "cheapest first"


def test_the_same_tasks_are_looked_at_once() -> None:
    """Whoever asks second, with a list of its own, is told what the first was told."""
    prospects, looks = Prospects(FLOOR, ROBOTS), 0

    class Counted(Nearby):
        def see(self, tasks: object) -> None:
            nonlocal looks
            looks += 1

    prospects._nearby = Counted(FLOOR)
    for robot in range(ROBOTS):
        tasks = [task_named(number, 0, number, number + 20) for number in range(8)]
        prospects.offers(BidWeights(), Availability(robot, robot, 0), tasks, 5)
    assert looks == 1

"""What a task costs a robot, and who wins which: the rule that all robots share, and no central step.

Every robot bids for every task that nobody has picked up yet, also for what another was awarded (re-auction of
untouched tasks) and also while it still carries something (it then counts from where and when it will be free). The
lowest bid of all wins first: it is the one that speaks soonest (design, section 4), and its robot then falls silent.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from onboard.systems.mapd.floor import Floor
from onboard.ways.steps import FAR


@dataclass(frozen=True, slots=True)
class TransportTask:
    """Take what is in cell ``pickup`` to cell ``delivery``; known from step ``release`` on."""

    number: int
    release: int
    pickup: int
    delivery: int


@dataclass(frozen=True, slots=True)
class Availability:
    """Where a robot will be free, and in how many steps from now."""

    robot: int
    cell: int
    steps: int


@dataclass(frozen=True, slots=True)
class BidWeights:
    """Weights of a bid, in hundredths of a step for each step; the bid is an integer and ties go to lower numbers."""

    wait: int = 100
    empty: int = 100
    loaded: int = 50
    #: For each step that a task is younger than the oldest that is open: what is added to no other can wait for ever.
    younger: int = 2


def oldest(tasks: Iterable[TransportTask]) -> int:
    """The first release of open tasks, 0 where there are none."""
    return min((task.release for task in tasks), default=0)


def cost(floor: Floor, rule: BidWeights, offer: Availability, task: TransportTask, first: int = 0) -> int | None:
    """The bid for one task, ``first`` being the release of the oldest that is open; None where no way leads.

    Steps until the robot is free, steps to the pick-up and steps with the load: by the added service time of all who
    wait, the shortest work goes first (Smith's rule, 1956). Whatever comes later counts as farther by ``younger`` a
    step: after so many steps no new task is before an old one.
    """
    empty = floor.steps_to(task.pickup)[offer.cell]
    loaded = floor.steps_to(task.delivery)[task.pickup]
    if empty >= FAR or loaded >= FAR:
        return None
    return rule.wait * offer.steps + rule.empty * empty + rule.loaded * loaded + rule.younger * (task.release - first)


def winners(
    floor: Floor, rule: BidWeights, offers: Sequence[Availability], tasks: Sequence[TransportTask]
) -> dict[int, tuple[TransportTask, int]]:
    """Task and bid that each robot wins, by robot: lowest bid first, then lower robot, then lower task."""
    bids: dict[int, list[tuple[int, int, int]]] = {}
    by_number: Mapping[int, TransportTask] = {task.number: task for task in tasks}
    first = oldest(tasks)
    for offer in offers:
        own = []
        for task in tasks:
            bid = cost(floor, rule, offer, task, first)
            if bid is not None:
                own.append((bid, task.number))
        own.sort(reverse=True)
        bids[offer.robot] = [(bid, offer.robot, number) for bid, number in own]
    won: dict[int, tuple[TransportTask, int]] = {}
    gone: set[int] = set()
    while bids:
        for robot in list(bids):
            while bids[robot] and bids[robot][-1][2] in gone:
                bids[robot].pop()
            if not bids[robot]:
                del bids[robot]
        if not bids:
            break
        bid, robot, number = min(left[-1] for left in bids.values())
        won[robot] = (by_number[number], bid)
        gone.add(number)
        del bids[robot]
    return won

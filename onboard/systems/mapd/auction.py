"""What a task costs a robot, and who wins which: the rule that all robots share, and no central step.

Every robot bids for every task that nobody has picked up yet, also for what another was awarded (re-auction of
untouched tasks) and also while it still carries something (it then counts from where and when it will be free). The
lowest bid of all wins first: it is the one that speaks soonest (design, section 4), and its robot then falls silent.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
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
    #: For each step that a task is younger than the oldest that is open, so that none waits for ever: this where there
    #: is no more than a task a robot, a share of it where there are more.
    younger: int = 20


@dataclass(frozen=True, slots=True)
class Backlog:
    """What is open: the release of the oldest task, how many tasks, and how many robots there are for them."""

    oldest: int
    tasks: int
    robots: int

    @classmethod
    def of(cls, tasks: Collection[TransportTask], robots: int) -> "Backlog":
        """That of these open tasks."""
        return cls(min((task.release for task in tasks), default=0), len(tasks), robots)


#: Where nobody has more to do than one task, and none is older than another.
NOTHING_OPEN = Backlog(0, 0, 1)


def cost(
    floor: Floor, rule: BidWeights, offer: Availability, task: TransportTask, backlog: Backlog = NOTHING_OPEN
) -> int | None:
    """The bid for one task, ``backlog`` being all that is open; None where no way leads.

    Steps until the robot is free, steps to the pick-up and steps with the load: by the added service time of all who
    wait, the shortest work goes first (Smith's rule, 1956). Whatever comes later counts as farther by ``younger`` a
    step: after so many steps no new task is before an old one. An old task that is done first is waited for by all who
    come behind it: with n tasks a robot each step of age counts an nth.
    """
    found = bids(floor, rule, offer, (task,), backlog)
    return found[0][0] if found else None


def bids(
    floor: Floor, rule: BidWeights, offer: Availability, tasks: Iterable[TransportTask], backlog: Backlog
) -> list[tuple[int, int]]:
    """The bid and the number of each task to which a way leads, in the order of ``tasks``; as ``cost`` one by one."""
    steps_to, cell, younger = floor.steps_to, offer.cell, rule.younger * backlog.robots
    share, weight, weight_loaded = max(backlog.robots, backlog.tasks), rule.empty, rule.loaded
    wait, oldest = rule.wait * offer.steps, backlog.oldest
    found = []
    for task in tasks:
        pickup = task.pickup
        empty, loaded = steps_to(pickup)[cell], steps_to(task.delivery)[pickup]
        if empty < FAR and loaded < FAR:
            later = younger * (task.release - oldest) // share
            found.append((wait + weight * empty + weight_loaded * loaded + later, task.number))
    return found


def winners(
    floor: Floor, rule: BidWeights, offers: Sequence[Availability], tasks: Sequence[TransportTask]
) -> dict[int, tuple[TransportTask, int]]:
    """Task and bid that each robot wins, by robot: lowest bid first, then lower robot, then lower task."""
    left: dict[int, list[tuple[int, int, int]]] = {}
    by_number: Mapping[int, TransportTask] = {task.number: task for task in tasks}
    backlog = Backlog.of(tasks, len(offers))
    for offer in offers:
        own = sorted(bids(floor, rule, offer, tasks, backlog), reverse=True)
        left[offer.robot] = [(bid, offer.robot, number) for bid, number in own]
    won: dict[int, tuple[TransportTask, int]] = {}
    gone: set[int] = set()
    while left:
        for robot in list(left):
            while left[robot] and left[robot][-1][2] in gone:
                left[robot].pop()
            if not left[robot]:
                del left[robot]
        if not left:
            break
        bid, robot, number = min(own[-1] for own in left.values())
        won[robot] = (by_number[number], bid)
        gone.add(number)
        del left[robot]
    return won

"""What a task costs a robot, and who wins which: the rule that all robots share, and no central step.

Every robot bids for every task that nobody has picked up yet, also for what another was awarded (re-auction of
untouched tasks) and also while it still carries something (it then counts from where and when it will be free). The
lowest bid of all wins first: it is the one that speaks soonest (design, section 4), and its robot then falls silent.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.nearby import Nearby
from onboard.systems.mapd.tasks import TransportTask
from onboard.ways.steps import FAR

#: Steps without a new task after which a robot takes it that what is open is all there is: as long as a usual task
#: takes; where tasks come at all steadily, one comes sooner.
QUIET_STEPS = 20


@dataclass(frozen=True, slots=True)
class Availability:
    """Where a robot will be free, and in how many steps from now."""

    robot: int
    cell: int
    steps: int


@dataclass(frozen=True, slots=True)
class BidWeights:
    """Weights of a bid, in hundredths of a step for each step; the bid is an integer and ties go to lower numbers.

    ``crowded_wait`` and ``crowded_loaded`` take the place of ``wait`` and ``loaded`` by and by where many tasks are
    open for each robot (``Backlog.crowd``).
    """

    wait: int = 100
    empty: int = 100
    loaded: int = 50
    #: For each step that a task is younger than the oldest that is open, so that none waits for ever: this where there
    #: is no more than a task a robot, a share of it where there are more.
    younger: int = 20
    #: The same once no more tasks come: none of those that are open can be passed by for ever.
    younger_at_last: int = 15
    crowded_wait: int = 50
    crowded_loaded: int = 27
    #: Where much is open: for each step from its end to the next task, and for each that others end nearer to it.
    nearby: int = 55
    #: Where all are shared out, for each step that a task is shorter than the longest: what takes longest begins first.
    shorter: int = 300

    def least_weights(self) -> tuple[int, int]:
        """What each step to the pick-up from where its robot is now, and each with the load, adds to a bid at least."""
        return min(self.wait, self.crowded_wait, self.empty), min(self.loaded, self.crowded_loaded)


@dataclass(frozen=True, slots=True)
class Backlog:
    """What is open: the release of the oldest task, how many tasks, and how many robots there are for them.

    ``is_all`` is whether nothing new is open since ``QUIET_STEPS``; ``longest`` the most steps with a load, worked out
    only where that is so and there is no task for each robot. ``nearby`` knows the open tasks, None for no look at it.
    """

    oldest: int
    tasks: int
    robots: int
    is_all: bool = False
    longest: int = 0
    nearby: Nearby | None = None

    @classmethod
    def of(cls, nearby: Nearby, tasks: Collection[TransportTask], robots: int, step: int) -> "Backlog":
        """That of these open tasks, which ``nearby`` has seen, in this step."""
        oldest = min((task.release for task in tasks), default=0)
        is_all = step - max((task.release for task in tasks), default=step) >= QUIET_STEPS
        longest = 0
        if is_all and len(tasks) < robots:
            ways = (nearby.floor.steps_to(task.delivery)[task.pickup] for task in tasks)
            longest = max((steps for steps in ways if steps < FAR), default=0)
        return cls(oldest, len(tasks), robots, is_all, longest, nearby)

    @property
    def crowd(self) -> int:
        """How far it counts that others wait behind a task, per cent: from one task a robot on, wholly from two on.

        Wholly, too, where no more tasks come: the last ones are then to be reached soon.
        """
        return 100 if self.is_all else max(0, min(100, 100 * (self.tasks - self.robots) // self.robots))


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

    Where much is open a step without a load keeps all the others waiting, and who will soon be free need not be before
    a robot from afar: the ways with a load and until it is free count less, and a task is the cheaper the nearer others
    begin where it ends, and the fewer end near where it begins. What is left at last, fewer tasks than robots of which
    no more come, is begun longest first (Graham's rule, 1969): all end sooner.
    """
    found = bids(floor, rule, offer, (task,), backlog)
    return found[0][0] if found else None


def bids(
    floor: Floor, rule: BidWeights, offer: Availability, tasks: Iterable[TransportTask], backlog: Backlog
) -> list[tuple[int, int]]:
    """The bid and the number of each task to which a way leads, in the order of ``tasks``; as ``cost`` one by one."""
    return offered(rule, offer, backlog, shares(floor, rule, tasks, backlog))


class Share(NamedTuple):
    """What of a bid for one task is the same for all robots, and the steps to its pick-up from each cell."""

    steps: Sequence[int]
    number: int
    part: int


def shares(floor: Floor, rule: BidWeights, tasks: Iterable[TransportTask], backlog: Backlog) -> list[Share]:
    """That of each task which can be delivered, in the order of ``tasks``."""
    steps_to = floor.steps_to
    younger = (rule.younger_at_last if backlog.is_all else rule.younger) * backlog.robots
    count, robots, crowd, nearby = backlog.tasks, backlog.robots, backlog.crowd, backlog.nearby
    share, oldest, longest = max(robots, count), backlog.oldest, backlog.longest
    weight_loaded = (100 * rule.loaded - (rule.loaded - rule.crowded_loaded) * crowd) // 100
    # Of the steps that a task is shorter than the longest, where not every robot gets one.
    shorter = rule.shorter * (robots - count) // robots if longest else 0
    beside = rule.nearby * crowd
    found = []
    for task in tasks:
        pickup = task.pickup
        loaded = steps_to(task.delivery)[pickup]
        if loaded < FAR:
            later = younger * (task.release - oldest) // share
            later += shorter * (longest - loaded)
            if crowd and nearby is not None:
                later += beside * nearby.dearer(task) // 100
            found.append(Share(steps_to(pickup), task.number, weight_loaded * loaded + later))
    return found


def offered(rule: BidWeights, offer: Availability, backlog: Backlog, known: Iterable[Share]) -> list[tuple[int, int]]:
    """One robot's bid for each task that it can reach, with its number, from the ``shares``."""
    cell, weight, wait = offer.cell, rule.empty, until_free(rule, offer, backlog)
    return [(wait + weight * empty + part, number) for steps, number, part in known if (empty := steps[cell]) < FAR]


def until_free(rule: BidWeights, offer: Availability, backlog: Backlog) -> int:
    """What the steps until a robot is free add to its bid for any task."""
    robots = backlog.robots
    lighter = backlog.crowd * min(4 * robots, backlog.tasks) // (4 * robots)
    return (100 * rule.wait - (rule.wait - rule.crowded_wait) * lighter) * offer.steps // 100


def winners(
    nearby: Nearby, rule: BidWeights, offers: Sequence[Availability], tasks: Sequence[TransportTask], step: int
) -> dict[int, tuple[TransportTask, int]]:
    """Task and bid that each robot wins, by robot: lowest bid first, then lower robot, then lower task."""
    left: dict[int, list[tuple[int, int, int]]] = {}
    by_number: Mapping[int, TransportTask] = {task.number: task for task in tasks}
    nearby.see(tasks)
    backlog = Backlog.of(nearby, tasks, len(offers), step)
    for offer in offers:
        own = sorted(bids(nearby.floor, rule, offer, tasks, backlog), reverse=True)
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

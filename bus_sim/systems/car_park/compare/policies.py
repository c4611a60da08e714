"""Who decides who does what: central dispatchers of growing wit.

Nearest-first and random are the simple rules for automated guided vehicles of Egbelu and Tanchoco (1984): whenever a
vehicle is free and a task waits, the pair with the shortest empty way goes first, or any pair. The joint choice looks
at all open tasks and all robots together, also at those that are still busy.
"""

import random
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from bus_sim.systems.car_park.compare.prospect import Prospect, serves_customer_us
from onboard.contract.messages import CallForProposals
from onboard.systems.car_park.alternatives import Solution
from onboard.ways.reservations import FOREVER

#: What a task counts for which nobody waits: somebody may come. In customers (1 decides alike).
NOBODY_YET = 0.5
#: What a second of a robot's time counts beside a customer's (0.02 and 0.3 decide alike).
ROBOT_TIME = 0.1
#: A plan that leaves a task out is as bad as one that ends it so much later, us: more than any task takes.
LEFT_OUT_US = 900_000_000
#: Bound of one joint choice, in searches of single tasks (a wall-time bound would not replay).
MAX_SEARCHES = 24


#: A robot may be given its next task so long before its last work ends, us: its next way then follows without a stop,
#: lifts come in time, and others plan around it. Too early leaves less to decide anew: the best of 15, 30, 60 and
#: 120 s for the joint choice; rules that ask only for free robots send them just before they stand.
JOINT_AHEAD_US, RULE_AHEAD_US = 120_000_000, 30_000_000


class OpenTask(NamedTuple):
    """A task that no robot has begun, and how many customers it keeps waiting now."""

    call: CallForProposals
    waiting: int


class Dispatch(NamedTuple):
    """One robot is to do one task, as planned."""

    node: int
    call: CallForProposals
    solution: Solution


@dataclass(frozen=True)
class DispatchScene:
    """All that a dispatcher sees: robots as they are, those ``free`` to begin, and tasks by their age."""

    prospect: Prospect
    free: tuple[int, ...]
    tasks: tuple[OpenTask, ...]


class Policy(Protocol):
    """A dispatcher's rule. A robot counts as free ``ahead_us`` before its last work ends."""

    name: str
    ahead_us: int

    def choose(self, scene: DispatchScene) -> list[Dispatch]:
        """What is to be begun now; what is left out is decided anew later."""


class NearestFirst:
    """The shortest empty way first."""

    name = "nearest first"
    ahead_us = RULE_AHEAD_US

    def choose(self, scene: DispatchScene) -> list[Dispatch]:
        """Pairs of a free robot and a task by empty travelling time; ties by age of the task, then node-ID."""

        def key(pair: "_Pair", prospect: Prospect) -> tuple[int, int, int]:
            start_us = prospect.start(pair.node)[1]
            return prospect.reach_us(pair.node, pair.task.call) - start_us, scene.tasks.index(pair.task), pair.node

        return _one_by_one(scene, lambda pairs, prospect: sorted(pairs, key=lambda pair: key(pair, prospect)))


@dataclass
class AnyFirst:
    """Any free robot, any task, by chance."""

    seed: int
    name: str = "random"
    ahead_us: int = RULE_AHEAD_US
    chance: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self.chance = random.Random(f"dispatcher:{self.seed}")

    def choose(self, scene: DispatchScene) -> list[Dispatch]:
        """Pairs of a free robot and a task in random order."""
        return _one_by_one(scene, lambda pairs, _: self.chance.sample(pairs, len(pairs)))


class _Pair(NamedTuple):
    node: int
    task: OpenTask


class _Ranking(Protocol):
    def __call__(self, pairs: "list[_Pair]", prospect: Prospect) -> "list[_Pair]": ...


def _one_by_one(scene: DispatchScene, rank: _Ranking) -> list[Dispatch]:
    """The first pair that can be planned, then the first of the rest, until no pair is left."""
    orders: list[Dispatch] = []
    prospect, free, tasks = scene.prospect, list(scene.free), list(scene.tasks)
    found = True
    while found and free and tasks:
        found = False
        for pair in rank([_Pair(node, task) for node in free for task in tasks], prospect):
            solution = prospect.solve(pair.node, pair.task.call)
            if solution is not None:
                orders.append(Dispatch(pair.node, pair.task.call, solution))
                prospect = prospect.after(pair.node, solution)
                free.remove(pair.node)
                tasks.remove(pair.task)
                found = True
                break
    return orders


class JointChoice:
    """The best assignment and order of all open tasks by the customers' total waiting, decided anew at each event.

    Branch and bound over who does which task next, deepest first by the free-flow bound, each task planned by the
    robot's own planner behind and around those before it; bounded by ``MAX_SEARCHES``. Only what a free robot would do
    first is ordered.
    """

    name = "joint choice"
    ahead_us = JOINT_AHEAD_US

    def choose(self, scene: DispatchScene) -> list[Dispatch]:
        """What free robots do first in the best plan found."""
        search = _JointChoice(scene)
        search.run()
        orders: list[Dispatch] = []
        begun: set[int] = set()
        for order in search.best:
            if order.node not in begun and order.node in scene.free:
                orders.append(order)
            begun.add(order.node)
        return orders


class _JointChoice:
    """One joint choice. Costs are in us of customers' waiting from now on."""

    def __init__(self, scene: DispatchScene) -> None:
        self._scene = scene
        self._nodes = sorted(scene.prospect.planners)
        self._searches = 0
        self._known: dict[tuple[tuple[int, CallForProposals], ...], Solution | None] = {}
        self.best: tuple[Dispatch, ...] = ()
        self.best_cost = float("inf")

    def run(self) -> None:
        """Find ``best``."""
        self._descend(self._scene.prospect, (), self._scene.tasks, 0.0)

    def _descend(
        self, prospect: Prospect, orders: tuple[Dispatch, ...], left: tuple[OpenTask, ...], cost: float
    ) -> None:
        if not left:
            if cost < self.best_cost:
                self.best, self.best_cost = orders, cost
            return
        bounds = {task: min(self._bound(prospect, node, task) for node in self._nodes) for task in left}
        rest = sum(bounds.values())
        choices = sorted(
            (cost + rest - bounds[task] + self._bound(prospect, node, task), number, node)
            for number, task in enumerate(left)
            for node in self._nodes
        )
        for bound, number, node in choices:
            if bound >= self.best_cost:
                return
            if self._searches >= MAX_SEARCHES and self.best:
                return
            task = left[number]
            others = left[:number] + left[number + 1 :]
            solution = self._solve(prospect, orders, node, task.call)
            if solution is None:
                continue
            order = Dispatch(node, task.call, solution)
            spent = cost + self._cost(task, serves_customer_us(task.call, solution), solution.finish_us)
            self._descend(prospect.after(node, solution), (*orders, order), others, spent)
        if cost + len(left) * LEFT_OUT_US < self.best_cost:
            self.best, self.best_cost = orders, cost + len(left) * LEFT_OUT_US

    def _solve(
        self, prospect: Prospect, orders: tuple[Dispatch, ...], node: int, call: CallForProposals
    ) -> Solution | None:
        key = (*((order.node, order.call) for order in orders), (node, call))
        if key not in self._known:
            self._searches += 1
            self._known[key] = prospect.solve(node, call)
        return self._known[key]

    def _bound(self, prospect: Prospect, node: int, task: OpenTask) -> float:
        """The least that a task can cost: the robot is there at once, and the car where it has to be."""
        reach_us = prospect.reach_us(node, task.call)
        return float("inf") if reach_us >= FOREVER else self._cost(task, reach_us, reach_us)

    def _cost(self, task: OpenTask, served_us: int, finish_us: int) -> float:
        now_us = self._scene.prospect.now_us
        return max(task.waiting, NOBODY_YET) * (served_us - now_us) + ROBOT_TIME * (finish_us - now_us)

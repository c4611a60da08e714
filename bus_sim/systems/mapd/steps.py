"""A pick-up and delivery day without frames: the machines' own decision functions, step by step, and a judge.

For benchmarks. Every step all robots bid anew for what is untouched; each that won or lost plans again around what the
others have published, in the order of the bids; then all move at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from onboard.systems.mapd.auction import Availability, BidWeights, winners
from onboard.systems.mapd.calls import CALLS_A_ROUND
from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.nearby import Nearby
from onboard.systems.mapd.paths import Path, Paths
from onboard.systems.mapd.search import find_path, is_sooner
from onboard.systems.mapd.tasks import TransportTask
from onboard.systems.mapd.waiting import WaitingPlaces


@dataclass
class SteppingRobot:
    """One robot. ``loaded`` is whether its task has been picked up; ``free_at`` the step of the planned delivery."""

    number: int
    home: int
    task: TransportTask | None = None
    loaded: bool = False
    free_at: int = 0


@dataclass
class SteppedDay:
    """A day's work: ``run`` plays it. ``served`` is the step at which each task was delivered, by number.

    ``searches`` were made, and in ``failures`` of them a robot kept its former path. ``rests`` are where robots may
    stay, ``ends`` where tasks begin and end. Without ``waits`` robots wait where they end, and who works makes no room
    and looks for no other way.
    """

    floor: Floor
    homes: Sequence[int]
    rests: frozenset[int]
    tasks: Sequence[TransportTask]
    rule: BidWeights = field(default_factory=BidWeights)
    ends: Sequence[int] = ()
    waits: bool = True
    step: int = 0
    served: dict[int, int] = field(default_factory=dict)
    searches: int = 0
    failures: int = 0
    #: Where each robot stood, step by step.
    history: list[tuple[int, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.robots = [SteppingRobot(number, home) for number, home in enumerate(self.homes)]
        self.paths = Paths(self.floor.network)
        for robot in self.robots:
            self.paths.put(robot.number, Path(0, (robot.home,)))
        self.waiting = sorted(self.tasks, key=lambda task: (task.release, task.number))[::-1]
        self.open: dict[int, TransportTask] = {}
        self.fresh = False
        self._nearby = Nearby(self.floor)
        self._working: set[int] = set()
        self._waiting = [WaitingPlaces(self.floor, self.ends) for _ in self.robots]
        # Whether somebody who planned right at its pick-up took the goods: the others see that in the next step.
        self._is_news = False
        self.history.append(tuple(self.homes))

    @property
    def is_over(self) -> bool:
        """Whether every task was served."""
        return len(self.served) == len(self.tasks)

    def run(self, limit: int = 20_000) -> "SteppedDay":
        """Play until every task is served or ``limit`` steps have gone."""
        while not self.is_over and self.step < limit:
            self._arrive()
            if not self.is_over:
                self._decide()
                self.step += 1
                self._judge()
        return self

    @property
    def service_time(self) -> float:
        """Mean steps from release to delivery over the tasks served."""
        release = {task.number: task.release for task in self.tasks}
        return sum(step - release[number] for number, step in self.served.items()) / len(self.served)

    @property
    def makespan(self) -> int:
        """Step of the last delivery."""
        return max(self.served.values())

    def at(self, robot: SteppingRobot) -> int:
        """Its cell at this step."""
        return self.paths.by_robot[robot.number].at(self.step)

    def _arrive(self) -> None:
        self.fresh, self._is_news = self._is_news, False
        for _ in range(CALLS_A_ROUND):
            if not self.waiting or self.waiting[-1].release > self.step:
                break
            # Others know only since when it is called for.
            task = replace(self.waiting.pop(), release=self.step)
            self.open[task.number] = task
            self.fresh = True
        for robot in self.robots:
            if robot.task is None:
                continue
            if not robot.loaded and self.at(robot) == robot.task.pickup:
                self._pick_up(robot, robot.task)
            if robot.loaded and self.at(robot) == robot.task.delivery:
                self.served[robot.task.number] = self.step
                robot.task, robot.loaded = None, False
                self.fresh = True

    def _pick_up(self, robot: SteppingRobot, task: TransportTask) -> None:
        robot.loaded = True
        self.fresh = True
        del self.open[task.number]

    def _offer(self, robot: SteppingRobot) -> Availability:
        if robot.loaded and robot.task is not None:
            return Availability(robot.number, robot.task.delivery, robot.free_at - self.step)
        return Availability(robot.number, self.at(robot), 0)

    def _decide(self) -> None:
        if not self.fresh and all(robot.task for robot in self.robots):
            return
        # By their words on this step, as on the bus.
        self._working = {robot.number for robot in self.robots if robot.task is not None}
        asking = {robot.number for robot in self.robots if self._wants_turn(robot)}
        offers, tasks = [self._offer(one) for one in self.robots], list(self.open.values())
        won = winners(self._nearby, self.rule, offers, tasks, self.step)
        for robot, task in self._in_turns(won, asking):
            self._plan(robot, task)

    def _in_turns(
        self, won: dict[int, tuple[TransportTask, int]], asking: set[int]
    ) -> list[tuple[SteppingRobot, TransportTask | None]]:
        """Who plans, and for which task, as the desk puts them in order."""
        first: list[tuple[SteppingRobot, TransportTask | None]] = []
        then: list[tuple[int, int, TransportTask]] = []
        last: list[tuple[SteppingRobot, TransportTask | None]] = []
        for robot in self.robots:
            task, bid = won.get(robot.number, (None, 0))
            is_asking = robot.number in asking
            must_yield = is_asking and self._is_in_the_way(robot)
            if robot.loaded:
                turns = first if must_yield else last
                turns += [(robot, None)] if is_asking else []
            elif task is not None and task != robot.task:
                then.append((bid, robot.number, task))
            elif must_yield or task != robot.task:
                first.append((robot, task))
            elif task is None and is_asking:
                last.append((robot, None))
        return first + [(self.robots[number], task) for _, number, task in sorted(then, key=lambda one: one[:2])] + last

    def _is_in_the_way(self, robot: SteppingRobot) -> bool:
        rest = self.paths.by_robot[robot.number].rest
        return rest != robot.home and rest in self._wanted

    def _wants_turn(self, robot: SteppingRobot) -> bool:
        path = self.paths.by_robot[robot.number]
        if robot.task is not None:
            return self.waits and (self._is_in_the_way(robot) or self._is_sooner(robot, robot.task))
        return path.rest not in self._rests(robot) or (self.waits and self._waits_better(robot, path) is not None)

    def _is_sooner(self, robot: SteppingRobot, task: TransportTask) -> bool:
        return robot.loaded and is_sooner(
            self.floor, self.paths, robot.number, self.step, task.delivery, self._rests(robot)
        )

    def _waits_better(self, robot: SteppingRobot, path: Path) -> int | None:
        others = []
        for one in self.robots:
            if one is not robot:
                its, works = self.paths.by_robot[one.number], one.number in self._working
                others.append((its.rest, max(0, its.end - self.step) if works else 0, works))
        return self._waiting[robot.number].better(path.rest, others, self._rests(robot))

    @property
    def _wanted(self) -> set[int]:
        """Where somebody has to pick up or deliver."""
        wanted = {cell for task in self.open.values() for cell in (task.pickup, task.delivery)}
        return wanted | {one.task.delivery for one in self.robots if one.loaded and one.task is not None}

    def _rests(self, robot: SteppingRobot) -> frozenset[int]:
        """Where it may end: not in others' homes, nor where somebody has to pick up or deliver; its home always."""
        return (self.rests - self._wanted - set(self.homes)) | {robot.home}

    def _ends(self, robot: SteppingRobot, old: Path, task: TransportTask | None) -> frozenset[int]:
        rests = self._rests(robot)
        if not self.waits or task is not None or robot.task is not None or old.rest not in rests:
            return rests
        better = self._waits_better(robot, old)
        return frozenset((old.rest if better is None else better,))

    def _plan(self, robot: SteppingRobot, task: TransportTask | None) -> None:
        """A path for a task, for what is aboard, or to a rest; where there is none it keeps its former path.

        Then it has no task but what is aboard.
        """
        old = self.paths.by_robot[robot.number]
        ends = self._ends(robot, old, task)
        self.paths.take(robot.number)
        aboard = robot.task if robot.loaded else None
        goals: tuple[int, ...] = () if task is None else (task.pickup, task.delivery)
        if aboard is not None:
            task, goals = aboard, (aboard.delivery,)
        self.searches += 1
        path = find_path(self.floor, self.paths, old.at(self.step), self.step, goals, ends)
        if path is None:
            self.failures += 1
            rest_of_old = tuple(old.at(step) for step in range(self.step, max(old.end, self.step) + 1))
            self.paths.put(robot.number, Path(self.step, rest_of_old))
            robot.task = aboard
            return
        self.paths.put(robot.number, path)
        robot.task = task
        if task is not None:
            first = path.arrival(goals[0], self.step)
            robot.free_at = path.arrival(task.delivery, first)
            if not robot.loaded and first == self.step:
                self._pick_up(robot, task)
                self._is_news = True

    def _judge(self) -> None:
        """Note where all stand. Raises ``AssertionError`` where two met, whatever their paths say."""
        before, now = self.history[-1], tuple(self.at(robot) for robot in self.robots)
        self.history.append(now)
        assert len({self.floor.resources[cell] for cell in now}) == len(now), f"two in one place, step {self.step}"
        moves = {(a, b) for a, b in zip(before, now, strict=True) if a != b}
        assert not any((b, a) in moves for a, b in moves), f"two robots change places, step {self.step}"

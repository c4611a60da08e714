"""What every machine of the site knows: tasks not yet served, where each robot is, its task, its path.

Made of frames alone, so that all have the same once all have heard all frames of a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from onboard.contract.mapd import PathHead, PathMoves, StepState
from onboard.contract.messages import Bid, CallForProposals
from onboard.core.serial import is_newer, ms_after
from onboard.systems.mapd.auction import BidWeights
from onboard.systems.mapd.calls import task_of
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.moves import Assembly
from onboard.systems.mapd.paths import Path, Paths
from onboard.systems.mapd.tasks import TransportTask, task_named
from onboard.ways.steps import STEP_US, cell_segment

#: The weights that all robots bid by, unless they are told others, and what a step adds at least by them.
PLAIN = BidWeights()
LEAST = PLAIN.least_weights()


@dataclass
class Knowledge:
    """``robots`` are the node-IDs of all robots; ``me`` is left out of what is asked for, 0 for a desk.

    ``states`` is the last word of each robot on its step; ``loads`` the tasks aboard, by robot.
    """

    floor: Floor
    robots: tuple[int, ...]
    me: int
    #: Length of a step, ms: a call's deadline tells by it when its task was released.
    step_ms: int = 1_000
    states: dict[int, StepState] = field(default_factory=dict)
    tasks: dict[int, TransportTask] = field(default_factory=dict)
    calls: dict[int, CallForProposals] = field(default_factory=dict)
    loads: dict[int, int] = field(default_factory=dict)
    #: Tasks that their robots stand beside with their new paths: theirs before they have come to another step.
    taken: dict[int, int] = field(default_factory=dict)
    paths: Paths = field(init=False)
    #: Step at which each robot's path as known begins, its version, and whether it said that it kept its former one.
    heads: dict[int, PathHead] = field(default_factory=dict)
    #: Complete paths that do not go with another's as known: mine or the other's is old.
    unfit: dict[int, tuple[PathHead, Path]] = field(default_factory=dict)
    _parts: dict[int, Assembly] = field(default_factory=dict)
    #: Tasks that were called for since the round before.
    _undated: set[int] = field(default_factory=set)
    #: What is open, and where somebody has to go; and which tasks were aboard as that was worked out, None for never.
    _open: tuple[list[TransportTask], frozenset[int]] = field(default_factory=lambda: ([], frozenset()))
    _open_of: frozenset[int] | None = None

    def __post_init__(self) -> None:
        self.paths = Paths(self.floor.network)
        self._all = frozenset(self.robots)

    # --- tasks and steps ---------------------------------------------------------------------------------------

    def on_call(self, call: CallForProposals) -> None:
        """A task is called for, or told again; how old it is says the next round."""
        number, cells = call.task.number, (call.from_station, call.to_station)
        if max(cells) < self.floor.size:
            if number not in self.tasks:
                self._undated.add(number)
                self.take_up(task_named(number, 0, *cells))
            self.calls[number] = call

    def take_up(self, task: TransportTask) -> None:
        """A task that is to be done, or is known better than before."""
        self.tasks[task.number] = task
        self._open_of = None

    def on_round(self, step: int, deadline_ms: int) -> None:
        """The round of a step is told, until that deadline: what was called for with it was released in that step.

        What was told again, as to who was started again, was so much earlier as its deadline was.
        """
        undated = [self.calls[number] for number in sorted(self._undated) if number in self.tasks]
        self._undated.clear()
        if undated:
            newest = min(undated, key=lambda call: ms_after(deadline_ms, call.deadline_ms))
            last = step - max(0, ms_after(deadline_ms, newest.deadline_ms)) // self.step_ms
            for call in undated:
                number, sooner_ms = call.task.number, ms_after(newest.deadline_ms, call.deadline_ms)
                known, release = self.tasks[number], last - round(sooner_ms / self.step_ms)
                self.take_up(task_named(number, release, known.pickup, known.delivery))

    def on_state(self, state: StepState) -> bool:
        """A robot's word; True where it is news."""
        known = self.states.get(state.sender)
        if state.sender not in self._all:
            return False
        if known is not None and state.step <= known.step:
            if state.step < known.step or state == known:
                return False
        elif known is not None:
            self.taken.pop(state.sender, None)
        self.states[state.sender] = state
        self.loads.pop(state.sender, None)
        if state.served:
            self.tasks.pop(state.task, None)
            self.calls.pop(state.task, None)
            self._open_of = None
        elif state.loaded:
            self.loads[state.sender] = state.task
        return True

    def is_possible(self, bid: Bid, weights: tuple[int, int] = LEAST) -> bool:
        """Whether a bid is no lower than the way from where its robot is; of what is not known yet any is.

        ``weights`` are the ``least_weights`` of the rule by which all bid.
        """
        state, task = self.states.get(bid.sender), self.tasks.get(task_of(bid))
        if state is None or task is None:
            return True
        steps_to, pickup, cell = self.floor.steps_to, task.pickup, state.cell
        if cell >= len(self.floor.names):
            return False
        return bid.cost >= weights[0] * steps_to(pickup)[cell] + weights[1] * steps_to(task.delivery)[pickup]

    def task_of(self, robot: int) -> int:
        """The task that a robot has by its last word, ``NO_TASK`` for none."""
        state = self.states.get(robot)
        return NO_TASK if state is None or state.served else state.task

    @property
    def open_tasks(self) -> Sequence[TransportTask]:
        """Tasks that nobody has picked up, lowest number first."""
        return self._looked_at[0]

    @property
    def wanted_cells(self) -> frozenset[int]:
        """Where somebody has to pick up or deliver."""
        return self._looked_at[1]

    @property
    def _looked_at(self) -> tuple[list[TransportTask], frozenset[int]]:
        """Worked out anew where a task came or went, was picked up or is known better."""
        gone = frozenset((*self.loads.values(), *self.taken.values()))
        if self._open_of != gone:
            tasks = self.tasks
            open_tasks = [tasks[number] for number in sorted(tasks) if number not in gone]
            ends = {task.delivery for task in tasks.values()}
            self._open = open_tasks, frozenset(ends.union([task.pickup for task in open_tasks]))
            self._open_of = gone
        return self._open

    def is_in_the_way(self, robot: int, home: int) -> bool:
        """Whether a robot's path ends where somebody has to pick up or deliver, and not at its ``home``."""
        path = self.paths.by_robot.get(robot)
        return path is not None and path.rest != home and path.rest in self.wanted_cells

    def others(self, me: int, step: int) -> list[tuple[int, int, bool]]:
        """Where all but one robot will be free: the cell, in how many steps, and whether each works until then."""
        found = []
        for robot, path in sorted(self.paths.by_robot.items()):
            if robot != me:
                works = self.task_of(robot) != NO_TASK
                found.append((path.rest, max(0, path.end - step) if works else 0, works))
        return found

    def forget_open(self) -> None:
        """Forget tasks that nobody has aboard: the desk says again which there are."""
        aboard = set(self.loads.values())
        self.tasks = {number: task for number, task in self.tasks.items() if number in aboard}
        self._open_of = None

    def behind(self, step: int) -> list[int]:
        """Robots that have not been heard to have come to a step."""
        states = self.states
        return [
            robot for robot in self.robots if robot != self.me and (robot not in states or states[robot].step < step)
        ]

    # --- paths -------------------------------------------------------------------------------------------------

    def on_head(self, head: PathHead) -> bool:
        """A path begins to be told; True where it is complete already and new."""
        known = self.heads.get(head.sender)
        if head.sender not in self._all or (known is not None and not _is_newer_path(head, known)):
            return False
        begun = self._parts.get(head.sender)
        if begun is None or begun.head != head:
            self._parts[head.sender] = Assembly(head)
        return self._complete(head.sender)

    def on_moves(self, moves: PathMoves) -> bool:
        """A part of it; True where the path is complete now."""
        begun = self._parts.get(moves.sender)
        if begun is None:
            return False
        begun.take(moves)
        return self._complete(moves.sender)

    def put(self, head: PathHead, path: Path) -> None:
        """Take a path up in place of the robot's former one; one that does not fit waits until others are known."""
        before = self.paths.take(head.sender)
        self.heads[head.sender] = head
        self.unfit.pop(head.sender, None)
        try:
            self.paths.put(head.sender, path)
        except ValueError:
            self.unfit[head.sender] = (head, path)
        if before is not None or self.unfit:
            self._fit_again()

    def _complete(self, robot: int) -> bool:
        begun = self._parts[robot]
        path = begun.path(self.floor)
        if path is None:
            return False
        del self._parts[robot]
        self.put(begun.head, path)
        return True

    def _fit_again(self) -> None:
        for robot, (_, path) in list(self.unfit.items()):
            try:
                self.paths.put(robot, path)
            except ValueError:
                continue
            del self.unfit[robot]

    def pathless(self) -> list[int]:
        """Robots to ask for their path: first those that leave no room for one that was told, whose own may be old.

        Then those whose path is not known, or does not fit to the others'.
        """
        in_the_way: set[int | None] = set()
        for _, path in self.unfit.values():
            in_the_way |= {self.paths.holder(cell, step) for step, cell in path.steps()}
            in_the_way |= {self.paths.holder(path.rest, step) for step in range(path.end, self.paths.horizon + 1)}
        others = [robot for robot in self.robots if robot in in_the_way and robot != self.me]
        return [*others, *(robot for robot in self.robots if robot not in self.paths.by_robot)]

    def next_user(self, resource: int, leaving: int = 0) -> int | None:
        """Who is to be in a cell or zone first, from each robot's own step on; None for nobody.

        ``leaving`` is a robot whose present step does not count any more.
        """
        found: list[tuple[int, int]] = []
        states, by_robot = self.states, self.paths.by_robot
        for begins_us, ends_us, robot in self.paths.reservations.on(cell_segment(resource)):
            path, state = by_robot[robot], states.get(robot)
            first = path.start if state is None else max(path.start, state.step + (robot == leaving))
            if ends_us > first * STEP_US:
                found.append((max(first * STEP_US, begins_us), robot))
        return min(found)[1] if found else None


def _is_newer_path(head: PathHead, known: PathHead) -> bool:
    return head.step > known.step or (head.step == known.step and is_newer(head.version, known.version, 8))

"""Everybody's published paths: which cell each robot holds at each step, and who stays where it ends.

The mirror of a pick-up and delivery site. Rules as of Ma, Li, Kumar and Koenig (AAMAS 2017): never two robots in one
cell at one step, never two that change places in one step; a robot may follow another into the cell that
it leaves: never a ring in which each follows the next.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

#: After every step.
NEVER = 1 << 40


@dataclass(frozen=True, slots=True)
class Path:
    """One robot's way: ``cells[i]`` at step ``start + i``, the last one for ever after."""

    start: int
    cells: tuple[int, ...]

    def at(self, step: int) -> int:
        """Cell at a step; before ``start`` the first, for a path that is heard may begin later."""
        return self.cells[max(0, min(step - self.start, len(self.cells) - 1))]

    @property
    def end(self) -> int:
        """First step of the stay in the last cell."""
        return self.start + len(self.cells) - 1

    @property
    def rest(self) -> int:
        """The cell in which it ends."""
        return self.cells[-1]

    def steps(self) -> Iterator[tuple[int, int]]:
        """All (step, cell) up to the stay."""
        return enumerate(self.cells, self.start)


class Paths:
    """The paths of all robots but those taken out. Steps and cells are integers; robots go by number.

    ``resources`` is the floor's: what standing in each cell takes.
    """

    def __init__(self, resources: Sequence[int]) -> None:
        self.size = len(resources)
        self.resources = resources
        self.by_robot: dict[int, Path] = {}
        self._held: dict[int, int] = {}
        self._rests: dict[int, tuple[int, int]] = {}
        self._last: dict[int, dict[int, int]] = {}

    def put(self, robot: int, path: Path) -> None:
        """Publish a path in place of the robot's former one. Raises ``ValueError`` where it meets another's."""
        self.take(robot)
        for step, cell in path.steps():
            other = self.holder(cell, step)
            if other is not None:
                self._take_steps(robot, path)
                raise ValueError(f"robot {robot} meets robot {other} in cell {cell} at step {step}")
            taken = self.resources[cell]
            self._held[step * self.size + taken] = robot
            self._last.setdefault(taken, {})[robot] = step
        if not self._may_stay(robot, path):
            self._take_steps(robot, path)
            raise ValueError(f"robot {robot} cannot stay in cell {path.rest} from step {path.end}")
        self._rests[self.resources[path.rest]] = (robot, path.end)
        self.by_robot[robot] = path

    def take(self, robot: int) -> Path | None:
        """Take a robot's path out; None where it has none."""
        path = self.by_robot.pop(robot, None)
        if path is not None:
            self._take_steps(robot, path)
            taken = self.resources[path.rest]
            if taken in self._rests and self._rests[taken][0] == robot:
                del self._rests[taken]
        return path

    def holder(self, cell: int, step: int) -> int | None:
        """Who is in a cell at a step."""
        taken = self.resources[cell]
        held = self._held.get(step * self.size + taken)
        if held is not None:
            return held
        rest = self._rests.get(taken)
        return rest[0] if rest is not None and rest[1] <= step else None

    def may_move(self, cell: int, to: int, step: int) -> bool:
        """Whether one in ``cell`` at ``step`` may be in ``to`` (the same, or beside it) a step later."""
        size, resources, held = self.size, self.resources, self._held
        taken = resources[to]
        rest = self._rests.get(taken)
        if rest is not None and rest[1] <= step + 1:
            return False
        if (step + 1) * size + taken in held:
            return False
        if to == cell:
            return True
        other = held.get(step * size + taken)
        return other is None or not self._goes_round(other, resources[cell], step)

    def _goes_round(self, robot: int, taken: int, step: int) -> bool:
        """Whether ``robot``, or one that it follows in this step, moves to what is ``taken`` by the asker now.

        With one other that is a swap. With more, nobody of the ring could be the first to begin: each enters a cell
        once the one before has begun to leave it.
        """
        asked = {robot}
        while True:
            to = self.resources[self.by_robot[robot].at(step + 1)]
            if to == taken:
                return True
            ahead = self._held.get(step * self.size + to)
            if ahead is None or ahead in asked:
                return False
            asked.add(ahead)
            robot = ahead

    def may_rest(self, cell: int, step: int) -> bool:
        """Whether one may stay in a cell for ever from a step on."""
        taken = self.resources[cell]
        return taken not in self._rests and all(last < step for last in self._last.get(taken, {}).values())

    def _may_stay(self, robot: int, path: Path) -> bool:
        taken = self.resources[path.rest]
        others = (last for one, last in self._last[taken].items() if one != robot)
        return taken not in self._rests and all(last < path.end for last in others)

    @property
    def horizon(self) -> int:
        """The step after which nobody moves any more."""
        return max((path.end for path in self.by_robot.values()), default=0)

    def _take_steps(self, robot: int, path: Path) -> None:
        for step, cell in path.steps():
            taken = self.resources[cell]
            key = step * self.size + taken
            if self._held.get(key) == robot:
                del self._held[key]
            self._last.get(taken, {}).pop(robot, None)

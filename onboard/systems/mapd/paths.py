"""Everybody's published paths: which cell each robot holds at each step, and who stays where it ends.

The mirror of a pick-up and delivery site. Rules as of Ma, Li, Kumar and Koenig (AAMAS 2017): never two robots in one
cell at one step, never two that change places in one step; a robot may follow another into the cell that
it leaves: never a ring in which each follows the next.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from onboard.ways.network import Network
from onboard.ways.reservations import Reservations, SlotWindow
from onboard.ways.steps import STEP_US, cell_segment, path_windows

#: Paths of which is kept what they take: of each robot its newest, and more.
MOST_KEPT = 1024
#: Asks for no robot: numbers of robots are not below 0.
NOBODY = -1


@dataclass(frozen=True, slots=True)
class Path:
    """One robot's way: ``cells[i]`` at step ``start + i``, the last one for ever after."""

    start: int
    cells: tuple[int, ...]

    def at(self, step: int) -> int:
        """Cell at a step; before ``start`` the first, for a path that is heard may begin later."""
        return self.cells[max(0, min(step - self.start, len(self.cells) - 1))]

    def arrival(self, cell: int, step: int) -> int:
        """The first step from ``step`` on at which the robot is in a cell, the ``end`` for one it comes to no more."""
        first = max(self.start, step)
        return next((at for at in range(first, self.end + 1) if self.at(at) == cell), max(self.end, step))

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

    What they take is in the ``reservations`` that all systems have; see ``onboard.ways.steps`` for how.
    """

    def __init__(self, network: Network[int]) -> None:
        self.network = network
        self.by_robot: dict[int, Path] = {}
        self.reservations = Reservations()

    def put(self, robot: int, path: Path) -> None:
        """Publish a path in place of the robot's former one. Raises ``ValueError`` where it meets another's."""
        self.take(robot)
        windows = _windows(self.network, path.start, path.cells)
        if not self.reservations.reserve_apart(robot, windows):
            for step, cell in path.steps():
                other = self.holder(cell, step)
                if other is not None:
                    raise ValueError(f"robot {robot} meets robot {other} in cell {cell} at step {step}")
            raise ValueError(f"robot {robot} cannot stay in cell {path.rest} from step {path.end}")
        self.by_robot[robot] = path

    def take(self, robot: int) -> Path | None:
        """Take a robot's path out; None where it has none."""
        path = self.by_robot.pop(robot, None)
        if path is not None:
            self.reservations.release(robot)
        return path

    def holder(self, cell: int, step: int) -> int | None:
        """Who is in a cell at a step."""
        begins_us, ends_us = step * STEP_US, (step + 1) * STEP_US
        for start_us, end_us, robot in self.reservations.on(cell_segment(self.network.takes[cell])):
            if start_us < ends_us and begins_us < end_us:
                return robot
        return None

    def goes_round(self, robot: int, cell: int, step: int, without: int = NOBODY) -> bool:
        """Whether ``robot``, or one that it follows in this step, moves to what ``cell`` takes; ``without`` is gone."""
        asked, takes = {robot}, self.network.takes
        while True:
            to = self.by_robot[robot].at(step + 1)
            if takes[to] == takes[cell]:
                return True
            ahead = self.holder(to, step)
            if ahead is None or ahead == without or ahead in asked:
                return False
            asked.add(ahead)
            robot = ahead

    @property
    def horizon(self) -> int:
        """The step after which nobody moves any more."""
        return max((path.end for path in self.by_robot.values()), default=0)


@lru_cache(maxsize=MOST_KEPT)
def _windows(network: Network[int], start: int, cells: tuple[int, ...]) -> list[SlotWindow]:
    """What a path takes: worked out once for all who hear of it in one process."""
    return path_windows(network, start, cells)

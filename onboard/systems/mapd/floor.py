"""The floor of a pick-up and delivery site: cells, one robot each, and the steps that lead from one to another.

A grid as in MovingAI's maps (Stern et al. 2019), or a network whose lines are cut into cells of one step. A *zone* is
a group of cells in which only one robot may be at a time: a lift, a block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

from onboard.ways.network import Network
from onboard.ways.steps import FAR

#: What a map calls free: floor, endpoints, homes, and MovingAI's other words for ground (swamp, ground).
FREE = frozenset(".erSG")


@dataclass(frozen=True)
class Floor:
    """``ways[cell]`` are the cells one step away (one-way where the other does not name it back).

    ``resources[cell]`` is what is taken by standing there: the same number for all cells of a zone. A blocked cell of a
    grid has no ways.
    """

    names: tuple[str, ...]
    ways: tuple[tuple[int, ...], ...]
    resources: tuple[int, ...]
    _fields: dict[int, list[int]] = field(default_factory=dict, compare=False, repr=False)
    _near: dict[tuple[int, int], list[tuple[int, int]]] = field(default_factory=dict, compare=False, repr=False)

    @property
    def size(self) -> int:
        """Number of cells, blocked ones included."""
        return len(self.names)

    @cached_property
    def network(self) -> Network[int]:
        """The cells and the steps between them, each of cost 1; what standing in a cell takes is its resource."""
        return Network(
            {cell: [(to, 1) for to in ways] for cell, ways in enumerate(self.ways)}, dict(enumerate(self.resources))
        )

    def steps_to(self, goal: int) -> list[int]:
        """Steps from each cell to a goal, nobody in the way; ``FAR`` where no way leads. Kept."""
        found = self._fields.get(goal)
        if found is None:
            found = self._fields[goal] = self.steps_to_any((goal,))
        return found

    def near_to(self, goal: int, below: int) -> list[tuple[int, int]]:
        """The cells from which a goal is fewer than ``below`` steps away, and in how many steps. Kept."""
        found = self._near.get((goal, below))
        if found is None:
            near = [(cell, steps) for cell, steps in enumerate(self.steps_to(goal)) if steps < below]
            found = self._near[goal, below] = near
        return found

    def steps_to_any(self, goals: Iterable[int]) -> list[int]:
        """Steps from each cell to the nearest of ``goals``, as ``steps_to``."""
        steps = self.network.costs_to(goals)
        return [steps.get(cell, FAR) for cell in range(self.size)]


def grid_floor(rows: Sequence[str]) -> Floor:
    """A floor from the rows of a map, all of one length; a cell is ``row * width + column``, named ``row,column``."""
    width = len(rows[0])
    free = [mark in FREE for row in rows for mark in row]
    ways: list[tuple[int, ...]] = []
    for cell, is_free in enumerate(free):
        column = cell % width
        beside = (
            cell - width,
            cell - 1 if column else -1,
            cell + 1 if column < width - 1 else -1,
            cell + width,
        )
        ways.append(tuple(to for to in beside if 0 <= to < len(free) and free[to]) if is_free else ())
    names = tuple(f"{cell // width},{cell % width}" for cell in range(len(free)))
    return Floor(names, tuple(ways), tuple(range(len(free))))


@dataclass(frozen=True, slots=True)
class NetworkLine:
    """A line of a network: from one named point to another in so many steps; both ways, or one."""

    start: str
    end: str
    steps: int
    one_way: bool = False


def network_floor(points: Sequence[str], lines: Sequence[NetworkLine], zones: Sequence[Sequence[str]]) -> Floor:
    """A floor from points and lines: a line of n steps has n - 1 cells of its own, named ``start>end/1`` and so on.

    A zone names points and lines (as ``start>end``); all of their cells are taken by whoever is on one of them.
    """
    names = list(points)
    number = {name: cell for cell, name in enumerate(points)}
    ways: list[list[int]] = [[] for _ in points]
    members: dict[str, list[int]] = {name: [cell] for name, cell in number.items()}
    for line in lines:
        between = list(range(len(names), len(names) + line.steps - 1))
        names += [f"{line.start}>{line.end}/{one}" for one in range(1, line.steps)]
        ways += [[] for _ in between]
        members.setdefault(f"{line.start}>{line.end}", []).extend(between)
        chain = [number[line.start], *between, number[line.end]]
        for cell, to in pairwise(chain):
            ways[cell].append(to)
            if not line.one_way:
                ways[to].append(cell)
    resources = list(range(len(names)))
    for zone in zones:
        cells = [cell for name in zone for cell in members[name]]
        # A cell of two zones makes them one.
        taken = {resources[cell] for cell in cells}
        resources = [min(taken) if one in taken else one for one in resources]
    return Floor(tuple(names), tuple(tuple(dict.fromkeys(one)) for one in ways), tuple(resources))

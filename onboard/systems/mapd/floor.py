"""The floor of a pick-up and delivery site: cells, one robot each, and the steps that lead from one to another.

A grid as in MovingAI's maps (Stern et al. 2019), or a network whose lines are cut into cells of one step. A *zone* is
a group of cells in which only one robot may be at a time: a lift, a block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

#: Steps to where no way leads; above every real distance.
FAR = 1 << 20
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
    _fields: dict[frozenset[int], list[int]] = field(default_factory=dict, compare=False, repr=False)

    @property
    def size(self) -> int:
        """Number of cells, blocked ones included."""
        return len(self.names)

    @cached_property
    def back(self) -> tuple[tuple[int, ...], ...]:
        """Cells from which one step leads to each."""
        back: list[list[int]] = [[] for _ in self.names]
        for cell, ways in enumerate(self.ways):
            for to in ways:
                back[to].append(cell)
        return tuple(tuple(one) for one in back)

    def steps_to(self, *goals: int) -> list[int]:
        """Steps from each cell to the nearest of ``goals``, nobody in the way; ``FAR`` where no way leads. Kept."""
        return self.steps_to_any(goals)

    def steps_to_any(self, goals: Iterable[int]) -> list[int]:
        """As ``steps_to``, for any collection of cells."""
        key = frozenset(goals)
        found = self._fields.get(key)
        if found is None:
            found = self._fields[key] = flood(self.back, key)
        return found


def flood(ways: Sequence[Sequence[int]], goals: Iterable[int], blocked: frozenset[int] = frozenset()) -> list[int]:
    """Steps over ``ways`` from the nearest of ``goals`` to each cell; ``blocked`` cells are reached but not passed."""
    steps = [FAR] * len(ways)
    border = sorted(goals)
    for goal in border:
        steps[goal] = 0
    distance = 0
    while border:
        distance += 1
        reached = []
        for cell in border:
            if distance > 1 and cell in blocked:
                continue
            for to in ways[cell]:
                if steps[to] > distance:
                    steps[to] = distance
                    reached.append(to)
        border = reached
    return steps


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


def lasting_rests(floor: Floor, rests: Sequence[int], goals: Iterable[int]) -> frozenset[int]:
    """Those of ``rests``, earlier ones first, in which robots may all stand for ever: whoever is left gets everywhere.

    With the rests taken so far blocked, each of them and of ``goals`` reaches each other one (well-formed instances of
    Ma, Li, Kumar and Koenig, AAMAS 2017). Where all pass together that is asked once. A zone's cells are never rests.
    """
    alone = [cell for cell in rests if floor.resources.count(floor.resources[cell]) == 1]
    needed = list(dict.fromkeys(goals))
    if _all_reach(floor, frozenset(alone), needed):
        return frozenset(alone)
    kept: list[int] = []
    for cell in alone:
        if _all_reach(floor, frozenset([*kept, cell]), needed):
            kept.append(cell)
    return frozenset(kept)


def _all_reach(floor: Floor, rests: frozenset[int], goals: Sequence[int]) -> bool:
    """Whether all goals and rests reach one another with no rest passed on the way."""
    needed = {*goals, *rests}
    if not needed:
        return True
    hub = next((cell for cell in sorted(needed) if cell not in rests), None)
    if hub is None:
        # Any cell beside a rest will do: all must meet there.
        ways = [to for to in floor.ways[min(needed)] if to not in rests]
        if not ways:
            return len(needed) == 1
        hub = ways[0]
    there = flood(floor.ways, [hub], rests)
    back = flood(floor.back, [hub], rests)
    return all(there[cell] < FAR and back[cell] < FAR for cell in needed)

"""The small warehouse for any number of robots, and its tasks at any rate: the files of Ma et al. that do not ship.

Maps and task files of Ma, Li, Kumar and Koenig (AAMAS 2017) ship for 10 and 30 robots, and 0.5, 2 and 10 tasks a step.
All three task files name the same 500 pairs of endpoints in the same order, so those of other rates are these pairs
again; other pairs are drawn by a seed. Homes that no shipped map has are drawn beside the racks of the two sides, where
all shipped homes are.
"""

import random
from fractions import Fraction
from importlib.resources import as_file, files
from itertools import product

from bus_sim.systems.mapd.importers.draft import Draft, TaskLine
from onboard.systems.mapd.floor import grid_floor
from onboard.ways.rests import lasting_rests

#: Robots and tasks a step of the published combinations (figures 5 and 6 there).
ROBOTS = (10, 20, 30, 40, 50)
RATES = ("0.2", "0.5", "1", "2", "5", "10", "500")
#: Tasks of a file.
TASKS = 500
#: What ships, fewest robots first: homes of the one are homes of the other.
_SHIPPED = (10, 30)
#: Cells of the great floor.
_GREAT_WIDTH, _GREAT_HEIGHT = 75, 41
#: Columns of the racks at the sides.
_SIDES = (*range(1, 7), *range(28, 34))


def shipped(name: str) -> str:
    """The text of a file that ships, without blanks at the ends."""
    with as_file(files("bus_sim") / "data" / "mapd" / name) as path:
        return path.read_text(encoding="utf-8").strip()


def map_text(robots: int) -> str:
    """The map with homes for so many robots, 1 to 50; the shipped one where there is one.

    Between 10 and 30 homes are the shipped 10 and some of the shipped 30, above that the shipped 30 and some that are
    drawn, in which nobody shuts others in. Raises ``ValueError`` where there is no room for so many.
    """
    fewer = max((one for one in _SHIPPED if one <= robots), default=_SHIPPED[0])
    rows = [list(row) for row in shipped(f"kiva-{fewer}-500-5.map").split()]
    chance = random.Random(f"kiva:{robots}")
    homes = _marked(rows, "r")
    for row, column in homes[robots:]:
        rows[row][column] = "."
    more = [list(row) for row in shipped(f"kiva-{_SHIPPED[-1]}-500-5.map").split()]
    wanted = [cell for cell in _marked(more, "r") if cell not in homes]
    if robots > _SHIPPED[-1]:
        wanted = [(row, column) for row, column in _marked(rows, ".") if column in _SIDES and 0 < row < len(rows) - 1]
    chance.shuffle(wanted)
    for row, column in wanted if len(homes) + len(wanted) >= robots else ():
        if len(_marked(rows, "r")) >= robots:
            break
        rows[row][column] = "r"
        if not _all_rest(rows):
            rows[row][column] = "."
    if len(_marked(rows, "r")) < robots:
        raise ValueError(f"no room for {robots} robots: {len(_marked(rows, 'r'))} have a home that shuts nobody in")
    return "\n".join("".join(row) for row in rows) + "\n"


def task_text(rate: str, seed: int = 0, count: int = TASKS) -> str:
    """A task file: ``count`` tasks, ``rate`` of them released a step; the pairs are the shipped ones for seed 0.

    ``rate`` is a positive number as text. Raises ``ValueError`` for any other, and for more shipped pairs than there
    are.
    """
    step = Fraction(rate)
    if step <= 0:
        raise ValueError(f"{rate} tasks a step: write a number above 0")
    return "".join(
        f"{int(number / step)}\t{pickup}\t{delivery}\t0\t0\n"
        for number, (pickup, delivery) in enumerate(_pairs(seed, count))
    )


def great_floor(robots: int, tasks: int, seed: int = 1) -> Draft:
    """A floor of 41 rows of 75 with so many robots, 120 at most, and so many tasks at once, drawn by ``seed``.

    Racks as in the small warehouse, five beside each other and ten behind; homes in six columns at the sides. Raises
    ``ValueError`` for more robots.
    """
    rows = [["."] * _GREAT_WIDTH for _ in range(_GREAT_HEIGHT)]
    for row, left in product(range(1, _GREAT_HEIGHT - 1), range(8, _GREAT_WIDTH - 18, 11)):
        if row % 4:
            rows[row][left : left + 10] = "@" * 10 if row % 4 == 2 else "e" * 10
    columns = [1, 3, 5, *(_GREAT_WIDTH - one for one in (2, 4, 6))]
    homes = [(row, column) for column in columns for row in range(1, _GREAT_HEIGHT - 1, 2)]
    if robots > len(homes):
        raise ValueError(f"{robots} robots: there are {len(homes)} homes")
    for row, column in homes[:robots]:
        rows[row][column] = "r"
    ends, chance = [f"{row},{column}" for row, column in _marked(rows, "e")], random.Random(seed)
    found = Draft(f"floor{robots}", ["drawn"], rows=["".join(row) for row in rows], endpoints=ends)
    found.robots = [(f"R{number}", f"{row},{column}") for number, (row, column) in enumerate(homes[:robots], 1)]
    found.tasks = [TaskLine(0, *chance.sample(ends, 2)) for _ in range(tasks)]
    return found


def _pairs(seed: int, count: int) -> list[tuple[int, int]]:
    if not seed:
        lines = [line.split() for line in shipped("kiva-0.5.task").splitlines()]
        if count > len(lines):
            raise ValueError(f"{count} tasks: there are {len(lines)} shipped ones, so give a seed from 1 on")
        return [(int(words[1]), int(words[2])) for words in lines[:count]]
    ends = range(shipped("kiva-10-500-5.map").count("e"))
    chance = random.Random(f"kiva:tasks:{seed}")
    pairs = [chance.sample(ends, 2) for _ in range(count)]
    return [(pickup, delivery) for pickup, delivery in pairs]


def _marked(rows: list[list[str]], mark: str) -> list[tuple[int, int]]:
    places = product(range(len(rows)), range(len(rows[0])))
    return [(row, column) for row, column in places if rows[row][column] == mark]


def _all_rest(rows: list[list[str]]) -> bool:
    """Whether all homes can be taken for ever and every endpoint is reached all the same."""
    width = len(rows[0])
    homes, ends = ([row * width + column for row, column in _marked(rows, mark)] for mark in "re")
    return len(lasting_rests(grid_floor(["".join(row) for row in rows]).network, homes, ends)) == len(homes)

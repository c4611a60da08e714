"""Grid maps of MovingAI (Stern et al. 2019) and the MAPD maps and task files of Ma, Li, Kumar and Koenig (AAMAS 2017).

A MAPD map marks endpoints ``e`` and robots' homes ``r``; its task file has ``release pickup delivery 0 0`` a line,
the ends being numbers of endpoints in reading order from 0. A map of MovingAI marks neither: homes, endpoints and tasks
are drawn.
"""

import random
from dataclasses import dataclass
from pathlib import Path

from bus_sim.systems.mapd.importers.draft import Draft, Loss, TaskLine, draw_tasks
from onboard.config.arguments import whole
from onboard.config.problems import Problems
from onboard.systems.mapd.floor import FREE, Floor, grid_floor
from onboard.systems.mapd.reader import BLOCKED, MAX_RELEASE, usual_width
from onboard.ways.rests import lasting_rests
from onboard.ways.steps import FAR

#: Endpoints drawn on a map that marks none: more than robots on the shipped maps.
ENDPOINTS = 20
_COLUMNS = 5


@dataclass(frozen=True, slots=True)
class DrawnDemand:
    """What is to be drawn where the file has none; ``robots`` None means four, or all homes that a MAPD map marks."""

    robots: int | None = None
    tasks: int = 20
    every: int = 5
    seed: int = 1


def read_map(text: str, problems: Problems) -> list[str]:
    """The rows of a map, with MovingAI's header, with the numbers above a MAPD map, or bare."""
    lines = [line.rstrip("\r") for line in text.split("\n")]
    while lines and not lines[-1].strip():
        lines.pop()
    first = _header(lines, problems)
    rows = lines[first:]
    if not rows or not rows[0]:
        problems.add(first + 1, "", None, "no map", "write the rows of cells")
        return []
    width = usual_width(rows)
    for number, row in enumerate(rows, start=first + 1):
        if len(row) != width:
            problems.add(number, "row", row, f"{len(row)} cells", f"write {width}, as in other rows")
        elif odd := sorted({*row} - FREE - {*BLOCKED}):
            free, blocked = " ".join(sorted(FREE)), " ".join(BLOCKED)
            problems.add(number, "cell", odd[0], "unknown", f"write {free} for free cells, {blocked} for blocked ones")
    return rows


def _header(lines: list[str], problems: Problems) -> int:
    """How many lines come before the rows; what they say of the size is compared with it."""
    if lines and lines[0].startswith("type"):
        for number, line in enumerate(lines[:20], start=1):
            if line.strip() == "map":
                _compare(lines, number, problems)
                return number
        problems.add(1, "type", lines[0], "a header without the line map", "write map before the first row")
        return len(lines)
    return next((at for at, line in enumerate(lines) if whole(line.replace(",", "").strip()) is None), len(lines))


def _compare(lines: list[str], first: int, problems: Problems) -> None:
    real = {"height": len(lines) - first, "width": len(lines[first]) if len(lines) > first else 0}
    for number, line in enumerate(lines[: first - 1], start=1):
        key, _, value = line.partition(" ")
        if key in real and value.strip() != str(real[key]):
            problems.add(number, key, value.strip(), f"the map has {real[key]}", f"write {key} {real[key]}")


def read_tasks(text: str, endpoints: list[str], problems: Problems) -> list[TaskLine]:
    """The tasks of a task file; a first line with their number alone is passed over."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = [whole(word) for word in line.split()]
        if not words or (number == 1 and len(words) == 1 and words[0] is not None):
            continue
        if len(words) not in (3, _COLUMNS) or None in words:
            form = "write release, pick-up, delivery, 0, 0 as whole numbers of 0 or more"
            problems.add(number, "task", line.strip(), "not a task", form)
            continue
        release, *ends = (word for word in words[:3] if word is not None)
        far = [end for end in ends if end >= len(endpoints)]
        if far:
            what = f"the map has {len(endpoints)} endpoints"
            problems.add(number, "endpoint", far[0], what, f"write numbers from 0 to {len(endpoints) - 1}")
        elif release > MAX_RELEASE:
            problems.add(number, "release", release, "too late", f"write a step from 0 to {MAX_RELEASE}")
        else:
            found.append(TaskLine(release, endpoints[ends[0]], endpoints[ends[1]]))
    return found


def import_map(path: Path, text: str, tasks: tuple[Path, str] | None, wanted: DrawnDemand) -> Draft:
    """A site of a map and, where the map marks endpoints, of a task file. Raises ``ConfigError`` with every mistake."""
    problems = Problems(str(path))
    rows = read_map(text, problems)
    problems.raise_if_any()
    floor = grid_floor(rows)
    marks = "".join(rows)
    endpoints = [floor.names[cell] for cell, mark in enumerate(marks) if mark == "e"]
    homes = [floor.names[cell] for cell, mark in enumerate(marks) if mark == "r"]
    draft = Draft(path.stem, [path.name], rows=rows)
    if tasks is not None and not endpoints:
        problems.add(0, "e", None, "the map marks no endpoints", "a task file needs a map that marks them by e")
    if endpoints and not homes:
        problems.add(0, "r", None, "endpoints, but no robots' homes", "mark the homes by r")
    problems.raise_if_any()
    if not endpoints:
        homes, endpoints = _draw(floor, wanted, problems)
        draft.meanings.append(f"The map marks no homes, endpoints and tasks: drawn with seed {wanted.seed}.")
    elif wanted.robots is not None:
        if wanted.robots > len(homes):
            problems.add(0, "r", wanted.robots, f"the map has homes for {len(homes)} robots", "ask for fewer robots")
            problems.raise_if_any()
        homes = homes[: wanted.robots]
    draft.robots = [(f"R{number}", home) for number, home in enumerate(homes, start=1)]
    draft.endpoints = endpoints
    if tasks is None:
        draft.tasks = draw_tasks(endpoints, wanted.tasks, wanted.every, wanted.seed)
    else:
        problems = Problems(str(tasks[0]))
        draft.tasks = read_tasks(tasks[1], endpoints, problems)
        problems.raise_if_any()
        draft.sources.append(tasks[0].name)
        draft.name = f"{path.stem}_{tasks[0].stem}"
    if swamp := sum(mark in "SW" for mark in marks):
        draft.losses.append(Loss(f"{swamp} cells of swamp or water (S, W)", "swamp costs a step as other ground does"))
    return draft


def _draw(floor: Floor, wanted: DrawnDemand, problems: Problems) -> tuple[list[str], list[str]]:
    """Homes that shut nobody in, and endpoints that all reach, in the largest part of the map."""
    rng = random.Random(wanted.seed)
    part = _largest_part(floor)
    cells = rng.sample(part, len(part))
    robots = 4 if wanted.robots is None else wanted.robots
    ends = min(ENDPOINTS, len(cells) // 3)
    if ends >= 2:
        endpoints, others = cells[:ends], cells[ends:]
        homes: list[int] = []
        for cell in others:
            if len(homes) == robots:
                break
            if len(lasting_rests(floor.network, [*homes, cell], endpoints)) == len(homes) + 1:
                homes.append(cell)
        if len(homes) == robots:
            return [floor.names[cell] for cell in homes], [floor.names[cell] for cell in endpoints]
    problems.add(0, "robots", robots, "no room for so many to stay without shutting others in", "ask for fewer robots")
    problems.raise_if_any()
    return [], []


def _largest_part(floor: Floor) -> list[int]:
    left = {cell for cell in range(floor.size) if floor.ways[cell]}
    best: list[int] = []
    while left:
        reach = floor.steps_to(min(left))
        part = sorted(cell for cell in left if reach[cell] < FAR)
        left -= set(part)
        best = max(best, part, key=len)
    return best

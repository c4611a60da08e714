"""A site that is being imported, and its text as a site file."""

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.config.problems import quoted
from onboard.systems.mapd.floor import NetworkLine

_UNFIT = re.compile(r"[^A-Za-z0-9]+")
#: A machine's name goes into a DBC: 16 characters.
_LONGEST_NAME = 16


class Loss(NamedTuple):
    """One thing of the file that the site does not have, and why."""

    element: str
    why: str


class TaskLine(NamedTuple):
    """A task by the names of its cells."""

    release: int
    start: str
    end: str


@dataclass
class Draft:
    """What becomes a site file. The floor is ``rows``, or ``points``, ``lines`` and ``zones``; cells go by their names.

    ``meanings`` say what a cell is in the file's own words; ``losses`` what could not be carried over.
    """

    name: str
    sources: list[str]
    rows: list[str] = field(default_factory=list)
    points: list[str] = field(default_factory=list)
    lines: list[NetworkLine] = field(default_factory=list)
    zones: list[list[str]] = field(default_factory=list)
    robots: list[tuple[str, str]] = field(default_factory=list)
    endpoints: list[str] = field(default_factory=list)
    tasks: list[TaskLine] = field(default_factory=list)
    step_ms: int = 1_000
    meanings: list[str] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)


def machine_name(name: str, taken: Sequence[str]) -> str:
    """A name that a DBC can carry and that no other machine has: letters, digits and _, at most 16."""
    fit = _UNFIT.sub("_", name).strip("_") or "robot"
    if not fit[0].isalpha():
        fit = f"R{fit}"
    fit = fit[:_LONGEST_NAME].rstrip("_")
    number, found = 2, fit
    while found in taken:
        found = f"{fit[: _LONGEST_NAME - len(str(number))].rstrip('_')}{number}"
        number += 1
    return found


def site_name(name: str) -> str:
    """A name that a site may have: letters, digits, dots, - and _, at most 32, the first a letter or digit."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).lstrip("_.-")[:32] or "site"


def draw_tasks(endpoints: Sequence[str], count: int, every: int, seed: int) -> list[TaskLine]:
    """Tasks between two different endpoints drawn evenly, one released every ``every`` steps."""
    rng = random.Random(seed)
    found = []
    for number in range(count):
        start, end = rng.sample(list(endpoints), 2)
        found.append(TaskLine(number * every, start, end))
    return found


def site_text(draft: Draft) -> str:
    """The draft as a site file of the system ``mapd``; what was not carried over stands in comments on top."""
    lines = [f"# Imported from {', '.join(draft.sources)}.", *(f"# {one}" for one in draft.meanings)]
    lines += [f"# Not carried over: {element}: {why}" for element, why in draft.losses]
    lines += ["", "[site]", f"name = {quoted(site_name(draft.name))}", 'system = "mapd"', ""]
    lines += ["[steps]", f"step_ms = {draft.step_ms}", "", *_floor(draft)]
    lines += ["", "[[desks]]", 'name = "Desk"', "node = 1"]
    for node, (name, home) in enumerate(draft.robots, start=11):
        lines += ["", "[[robots]]", f"name = {quoted(name)}", f"node = {node}", f"home = {quoted(home)}"]
    lines += ["", "[demand]", *_list("endpoints", [quoted(one) for one in draft.endpoints])]
    lines += _list("tasks", [f"[{one.release}, {quoted(one.start)}, {quoted(one.end)}]" for one in draft.tasks])
    return "\n".join(lines) + "\n"


def _floor(draft: Draft) -> list[str]:
    if draft.rows:
        return ["[map]", *_list("rows", [quoted(row) for row in draft.rows])]
    one_way = {True: ', "one-way"', False: ""}
    found = ["[network]", *_list("points", [quoted(one) for one in draft.points])]
    found += _list(
        "lines",
        [f"[{quoted(one.start)}, {quoted(one.end)}, {one.steps}{one_way[one.one_way]}]" for one in draft.lines],
    )
    return found + _list("zones", ["[" + ", ".join(quoted(one) for one in zone) + "]" for zone in draft.zones])


def _list(name: str, items: list[str]) -> list[str]:
    return [f"{name} = [", *(f"  {item}," for item in items), "]"]

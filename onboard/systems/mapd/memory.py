"""What a robot writes down before it says or does it, and what it knows from there when it starts again."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from onboard.core.effects import Record
from onboard.systems.mapd.messages import NO_TASK
from onboard.systems.mapd.paths import Path


@dataclass(frozen=True)
class Past:
    """``path`` is the last one planned, under ``version``, for ``task``; ``step`` the last one to which it set out.

    Without a path there was no turn yet. ``served`` are the last task that was to be unloaded, and the step before.
    """

    path: Path | None = None
    version: int = 0
    task: int = NO_TASK
    step: int = 0
    served: tuple[int, int] = (NO_TASK, -1)


def path_record(path: Path, version: int, task: int) -> Record:
    """A path, before it is told."""
    cells = " ".join(map(str, path.cells))
    return Record({"record": "path", "step": path.start, "version": version, "task": task, "cells": cells})


def step_record(step: int) -> Record:
    """The step to which a robot is about to set out."""
    return Record({"record": "step", "step": step})


def served_record(task: int, step: int) -> Record:
    """A task that is about to be unloaded, at ``step`` or on the way from it."""
    return Record({"record": "served", "task": task, "step": step})


def read_past(entries: Iterable[Mapping[str, str | int]]) -> Past:
    """The journal's last words, oldest entry first; entries of other record types are passed over."""
    path, version, task, step, served = None, 0, NO_TASK, 0, (NO_TASK, -1)
    for entry in entries:
        if entry.get("record") == "path":
            cells = tuple(int(cell) for cell in str(entry["cells"]).split())
            path, version, task = Path(int(entry["step"]), cells), int(entry["version"]), int(entry["task"])
        elif entry.get("record") == "step":
            step = int(entry["step"])
        elif entry.get("record") == "served":
            served = int(entry["task"]), int(entry["step"])
    return Past(path, version, task, step, served)

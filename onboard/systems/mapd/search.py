"""Space-time A*: the earliest way through given cells around everybody's published paths, to a cell where one may stay.

Prioritised planning (Silver 2005): what others have published stands. As every path ends in a rest which nobody else
crosses later, one's former path always remains good: a search that finds nothing costs time, never a collision.
"""

from collections.abc import Sequence
from heapq import heappop, heappush

from onboard.systems.mapd.floor import FAR, Floor
from onboard.systems.mapd.paths import Path, Paths

#: Most states that one search may expand: bounded work, the same on every machine.
MOST_EXPANSIONS = 20_000


def find_path(
    floor: Floor, others: Paths, cell: int, step: int, goals: Sequence[int], rests: frozenset[int]
) -> Path | None:
    """From ``cell`` at ``step`` through ``goals`` in order, then to the nearest of ``rests``.

    The last goal is reached as early as can be; the way to the rest counts only after that. None where the bounded
    search finds no way. ``others`` must not hold the robot's own path.
    """
    # The time is bounded, as the search is: after the horizon nobody moves, and every way is shorter than the floor.
    fields = [floor.steps_to(goal) for goal in goals]
    after = [0] * (len(goals) + 1)
    for index in range(len(goals) - 2, -1, -1):
        after[index] = after[index + 1] + fields[index + 1][goals[index]]
    to_rest = floor.steps_to_any(rests)
    if any(after_one >= FAR for after_one in after) or (goals and fields[0][cell] >= FAR):
        return None
    limit = others.horizon + floor.size + step
    start = (cell, step, _passed(goals, 0, cell))
    came: dict[tuple[int, int, int], tuple[int, int, int] | None] = {start: None}
    heap = [(_left(fields, after, start[2], cell) + step, -step, start)]
    expanded = 0
    while heap and expanded < MOST_EXPANSIONS:
        state = heappop(heap)[2]
        at, now, leg = state
        if leg == len(goals):
            tail = _find_rest(floor, others, at, now, rests, to_rest, limit)
            if tail is not None:
                return Path(step, (*_back(came, state), *tail))
            continue
        expanded += 1
        if now >= limit:
            continue
        for to in (*floor.ways[at], at):
            next_leg = _passed(goals, leg, to)
            reached = (to, now + 1, next_leg)
            if reached in came or not others.may_move(at, to, now):
                continue
            came[reached] = state
            heappush(heap, (_left(fields, after, next_leg, to) + now + 1, -now - 1, reached))
    return None


def _passed(goals: Sequence[int], leg: int, cell: int) -> int:
    while leg < len(goals) and goals[leg] == cell:
        leg += 1
    return leg


def _left(fields: list[list[int]], after: list[int], leg: int, cell: int) -> int:
    return fields[leg][cell] + after[leg] if leg < len(fields) else 0


def _back(
    came: dict[tuple[int, int, int], tuple[int, int, int] | None], state: tuple[int, int, int] | None
) -> list[int]:
    cells = []
    while state is not None:
        cells.append(state[0])
        state = came[state]
    return cells[::-1]


def _find_rest(
    floor: Floor, others: Paths, cell: int, step: int, rests: frozenset[int], to_rest: list[int], limit: int
) -> list[int] | None:
    """Cells after ``cell`` on the earliest way to a rest."""
    start = (cell, step, 0)
    came: dict[tuple[int, int, int], tuple[int, int, int] | None] = {start: None}
    heap = [(to_rest[cell] + step, -step, start)]
    expanded = 0
    while heap and expanded < MOST_EXPANSIONS:
        state = heappop(heap)[2]
        at, now, _ = state
        if at in rests and others.may_rest(at, now):
            return _back(came, state)[1:]
        expanded += 1
        if now >= limit:
            continue
        for to in (*floor.ways[at], at):
            reached = (to, now + 1, 0)
            if reached not in came and to_rest[to] < FAR and others.may_move(at, to, now):
                came[reached] = state
                heappush(heap, (to_rest[to] + now + 1, -now - 1, reached))
    return None

"""The earliest way through given cells around everybody's published paths, to a cell where one may stay.

Prioritised planning (Silver 2005) by the search that all systems share: what others have published stands. As every
path ends in a rest which nobody else crosses later, one's former path always remains good: a search that finds nothing
costs time, never a collision.
"""

from collections.abc import Sequence
from itertools import pairwise

from onboard.contract.codes import LegAction
from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.paths import NOBODY, Path, Paths
from onboard.ways.reservations import FOREVER
from onboard.ways.sipp import NoRoute, Route, Visit, find_route
from onboard.ways.steps import FAR, STEP_US, StepGround, StepMoves, cell_segment

#: Most states that one search may expand: bounded work, the same on every machine.
MOST_EXPANSIONS = 20_000


def find_path(
    floor: Floor, others: Paths, cell: int, step: int, goals: Sequence[int], rests: frozenset[int]
) -> Path | None:
    """From ``cell`` at ``step`` through ``goals`` in order, then to the nearest of ``rests``.

    The last goal is reached as early as can be; the way to the rest counts only after that. None where the bounded
    search finds no way. ``others`` must not hold the robot's own path.
    """
    found = _find_route(floor, others, cell, step, goals, rests)
    if isinstance(found, NoRoute):
        return None
    cells = [cell]
    for leg in found.legs:
        steps = (leg.end_us - leg.begin_us) // STEP_US
        cells += [leg.to_index if leg.action is LegAction.TRAVEL else cells[-1]] * steps
    return Path(step, tuple(cells))


def _find_route(
    floor: Floor,
    others: Paths,
    cell: int,
    step: int,
    goals: Sequence[int],
    rests: frozenset[int],
    before_us: int = FOREVER,
) -> Route | NoRoute:
    """The same as a route; one that is at the last goal at ``before_us``, steps times ``STEP_US``, or later is none."""
    if any(floor.steps_to(goal)[before] >= FAR for before, goal in pairwise((cell, *goals))):
        return NoRoute("a goal is out of reach", 0)
    moves = StepMoves(floor.network, others.reservations, NOBODY, step, others.goes_round)
    visits = tuple(Visit(cell_segment(goal), 0) for goal in goals)
    refuges = frozenset(map(cell_segment, rests))
    ground = StepGround(floor.steps_to, floor.steps_to_any)
    return find_route(ground, moves, cell_segment(cell), step * STEP_US, visits, refuges, MOST_EXPANSIONS, before_us)


def is_sooner(floor: Floor, paths: Paths, robot: int, step: int, goal: int, rests: frozenset[int]) -> bool:
    """Whether a robot would now find a way that brings it to ``goal`` before its published path does.

    What it planned around may have gone elsewhere since. Its path is back in ``paths`` afterwards.
    """
    old = paths.by_robot[robot]
    here, arrival = old.at(step), old.arrival(goal, step)
    if arrival <= step + floor.steps_to(goal)[here] or not _may_be_there(floor, paths, robot, step, goal, arrival):
        return False
    paths.take(robot)
    found = _find_route(floor, paths, here, step, (goal,), rests, arrival * STEP_US)
    paths.put(robot, old)
    return isinstance(found, Route)


def _may_be_there(floor: Floor, paths: Paths, robot: int, step: int, goal: int, before: int) -> bool:
    """Whether a robot may be at ``goal`` before step ``before``: never False where a search finds a way.

    Step by step, from all cells where it may be to those that are near enough. Where to go from the goal is left to the
    search, which takes six times as long and nearly always said no (40 of 41 on a floor of 120 robots).
    """
    steps_to, ways, cells = floor.steps_to(goal), floor.ways, {paths.by_robot[robot].at(step)}
    for now in range(step + 1, before):
        from_cells, cells = cells, set()
        for cell in {to for here in from_cells for to in ways[here]} | from_cells:
            if steps_to[cell] < before - now and _may_enter(floor, paths, robot, from_cells, cell, now):
                cells.add(cell)
        if goal in cells:
            return True
    return False


def _may_enter(floor: Floor, paths: Paths, robot: int, from_cells: set[int], cell: int, now: int) -> bool:
    """Whether a cell is free at step ``now``, and may be entered, or stayed in, from one of these: in no ring."""
    begins_us, leaves = now * STEP_US, NOBODY
    for from_us, to_us, holder in paths.reservations.on(cell_segment(floor.resources[cell])):
        if holder != robot:
            if from_us < begins_us + STEP_US and begins_us < to_us:
                return False
            if to_us == begins_us:
                leaves = holder
    if leaves == NOBODY:
        return True
    befores = (here for here in from_cells if cell in floor.ways[here])
    return any(not paths.goes_round(leaves, here, now - 1, robot) for here in befores)

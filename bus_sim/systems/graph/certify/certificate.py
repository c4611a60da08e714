"""A certificate for a graph and a number of robots, or the counterexample (row G29), and the rows of section 2.4."""

import random
from dataclasses import dataclass
from itertools import islice
from math import comb, perm

from bus_sim.systems.graph.certify.model import ARRIVED, KEEPS, GraphModel, State
from bus_sim.systems.graph.certify.search import DeadlockSearch, Stuck, TaskSet, TooLargeError, task_sets
from onboard.systems.graph.network import Graph, complete, cube, grid, ring
from onboard.systems.graph.rules import Rules

#: States that a search may remember before it gives up: about half a gigabyte.
LIMIT = 1_500_000
#: As many task sets are listed to draw from them; of more they are drawn one by one.
MOST_LISTED = 2_000_000


@dataclass(frozen=True)
class Certificate:
    """What was found. ``certified`` None: the search was too large, and nothing sticks as far as it went."""

    certified: bool | None
    reason: str
    task_sets: int = 0
    stuck: Stuck | None = None


def certify(graph: Graph, robots: int, rules: Rules, capacity: int, limit: int = LIMIT) -> Certificate:
    """Whether so many robots, with any tasks, can stick under these rules; ``capacity`` is of every node."""
    if graph.dead_ends:
        nodes = ", ".join(f"N{node}" for node in graph.dead_ends)
        return Certificate(False, f"dead end at {nodes}: a robot that does not reverse never comes out (G02)")
    if robots > len(graph.nodes):
        return Certificate(False, f"{robots} robots do not find {len(graph.nodes)} nodes to start from")
    if rules is Rules.EDGE_AND_NODE and capacity >= robots:
        return Certificate(True, "who waits holds no edge, and every node has room for all robots")
    search = DeadlockSearch(GraphModel(graph, rules, capacity), limit)
    number = 0
    try:
        for number, tasks in enumerate(task_sets(graph, robots), start=1):
            if search.can_stick(tasks):
                return Certificate(False, f"task set {number} can stick", number, search.counterexample(tasks))
    except TooLargeError as error:
        return Certificate(None, f"undecided: {error}, at task set {number}", number)
    return Certificate(True, f"no timing of any of {number} task sets sticks", number)


def stuck_lines(stuck: Stuck) -> list[str]:
    """A counterexample in words, one line a step."""
    lines = [f"task set: {stuck.tasks}"]
    lines += [f"{n:3}. R{move.robot + 1} {move.word} N{move.node}" for n, move in enumerate(stuck.moves, start=1)]
    return [*lines, f"stuck: {_where(stuck.state)}"]


def _where(state: State) -> str:
    words = []
    for number, robot in enumerate(state, start=1):
        if robot.start == KEEPS:
            words.append(f"N{robot.node} keeps its edge to N{robot.goal}")
        elif robot.start == ARRIVED:
            words.append(f"R{number} is in N{robot.node}")
        elif robot.start < 0:
            words.append(f"R{number} waits in N{robot.node}")
        else:
            words.append(f"R{number} waits between N{robot.start} and N{robot.node}")
    return "; ".join(words)


@dataclass(frozen=True)
class CertificateRow:
    """A row of SYSTEMS 2.4: a graph and a number of robots; ``sample`` is how many task sets are drawn, and a seed."""

    name: str
    graph: Graph
    robots: int
    sample: tuple[int, int] | None = None


ROWS: tuple[CertificateRow, ...] = (
    CertificateRow("3x3 grid", grid(3, 3), 2),
    CertificateRow("3x3 grid", grid(3, 3), 3),
    CertificateRow("3x3 grid", grid(3, 3), 4, (4000, 7)),
    CertificateRow("cube Q3", cube(3), 2),
    CertificateRow("cube Q3", cube(3), 3),
    CertificateRow("ring C5", ring(5), 2),
    CertificateRow("ring C6", ring(6), 2),
    CertificateRow("ring C8", ring(8), 2),
    CertificateRow("ring C6", ring(6), 3),
    CertificateRow("K4", complete(4), 2),
    CertificateRow("K4", complete(4), 3),
    CertificateRow("K5", complete(5), 3),
)


def number_of_task_sets(graph: Graph, robots: int) -> int:
    """How many ``task_sets`` are: starts, times goals of which none is its robot's start (inclusion and exclusion)."""
    nodes = len(graph.nodes)
    signed = ((1 - own % 2 * 2) * comb(robots, own) * perm(nodes - own, robots - own) for own in range(robots + 1))
    goals = sum(signed)
    return comb(nodes, robots) * goals


def sampled(graph: Graph, robots: int, count: int, seed: int) -> list[TaskSet]:
    """Task sets drawn evenly and without repetition from all of them. Raises ``ValueError`` for more than there are."""
    chance = random.Random(seed)
    if number_of_task_sets(graph, robots) <= MOST_LISTED:
        return chance.sample(list(task_sets(graph, robots)), count)
    found: dict[TaskSet, None] = {}
    while len(found) < count:
        starts, goals = sorted(chance.sample(graph.nodes, robots)), chance.sample(graph.nodes, robots)
        if all(one != other for one, other in zip(starts, goals, strict=True)):
            found[TaskSet(tuple(starts), tuple(goals))] = None
    return list(found)


def count_stuck(
    graph: Graph,
    robots: int,
    rules: Rules,
    capacity: int = 1,
    most: int | None = None,
    sample: tuple[int, int] | None = None,
) -> tuple[int, int]:
    """How many task sets there are, and how many of them can stick.

    Of the first ``most`` only where that is given, or of those drawn by ``sample``, (count, seed).
    """
    search = DeadlockSearch(GraphModel(graph, rules, capacity))
    every = sampled(graph, robots, *sample) if sample is not None else task_sets(graph, robots)
    judged = [search.can_stick(tasks) for tasks in islice(every, most)]
    return len(judged), sum(judged)

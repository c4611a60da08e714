"""The least time in which robots of a graph can all come to their goals: a search through all joint moves.

Unit steps as long as an edge: in each step every robot goes along an edge or stays in its node; one robot an edge, no
turning back from one step to the next, any number of robots in a node. For small cases only: states grow as
(nodes times degree) to the number of robots.
"""

import random
from collections import deque
from itertools import product

from bus_sim.systems.graph.certify.search import TaskSet
from onboard.systems.graph.network import NOWHERE, Graph, edge

#: Where a robot is and whence it came.
_Place = tuple[int, int]


def least_steps(graph: Graph, tasks: TaskSet) -> int | None:
    """The exact optimum in steps, by breadth-first search; None where the goals cannot be reached."""
    first: tuple[_Place, ...] = tuple((NOWHERE, start) for start in tasks.starts)
    queue, seen = deque([(first, 0)]), {first}
    while queue:
        places, steps = queue.popleft()
        if tuple(node for _, node in places) == tasks.goals:
            return steps
        choices = [
            [(behind, node), *((node, after) for after in graph.neighbours[node] if after != behind)]
            for behind, node in places
        ]
        for following in product(*choices):
            moved = [edge(*new) for old, new in zip(places, following, strict=True) if old != new]
            if len(set(moved)) == len(moved) and following not in seen:
                seen.add(following)
                queue.append((following, steps + 1))
    return None


def some_tasks(graph: Graph, robots: int, cases: int, seed: int) -> list[TaskSet]:
    """Task sets drawn by chance; all starts differ, all goals, and each goal from its start."""
    chance = random.Random(f"optimum {seed} {robots}")
    found: list[TaskSet] = []
    while len(found) < cases:
        tasks = TaskSet(tuple(chance.sample(graph.nodes, robots)), tuple(chance.sample(graph.nodes, robots)))
        if all(start != goal for start, goal in zip(*tasks, strict=True)):
            found.append(tasks)
    return found

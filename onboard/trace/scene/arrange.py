"""Spots for the nodes of a network whose file names lengths only: stress majorization (Gansner, Koren, North 2004).

Two nodes want to be as far apart as the shortest way between them is long, the more the nearer they are; each is moved
to where the pulls on it meet, one after the other. Nothing is drawn by chance: the same network always looks the same.
"""

import heapq
from collections.abc import Mapping
from math import atan2, cos, hypot, sin

from onboard.trace.scene.scene import Spot

#: Moves of single nodes altogether, so that the largest network takes about two seconds; and rounds at most and least.
_WISHES, _MOST_ROUNDS, _LEAST_ROUNDS = 2_000_000, 300, 30
#: Nodes of parts that no way joins are so many times the longest way apart.
_APART = 1.3

Lengths = Mapping[tuple[int, int], float]


def arrange(lengths: Lengths, nodes: list[int], apart: float) -> dict[int, Spot]:
    """A spot for each node, the widest span level, the two nearest nodes ``apart``; the least x and y are 0."""
    if len(nodes) < 2:
        return dict.fromkeys(nodes, (0.0, 0.0))
    far = _distances(lengths, nodes)
    spots = _first_guess(far)
    for _ in range(max(_LEAST_ROUNDS, min(_MOST_ROUNDS, _WISHES // len(nodes) ** 2))):
        for mine in range(len(nodes)):
            spots[mine] = _wanted(mine, spots, far[mine])
    spots = _level(spots)
    least = min(_gap(one, other) for number, one in enumerate(spots) for other in spots[:number])
    scale = apart / max(least, 1e-6)
    x0, y0 = min(x for x, _ in spots), min(y for _, y in spots)
    return {node: ((x - x0) * scale, (y - y0) * scale) for node, (x, y) in zip(nodes, spots, strict=True)}


def _distances(lengths: Lengths, nodes: list[int]) -> list[list[float]]:
    """Shortest ways between all nodes (Dijkstra 1959), by their places in ``nodes``; ways count in both directions."""
    place = {node: number for number, node in enumerate(nodes)}
    beside: list[list[tuple[int, float]]] = [[] for _ in nodes]
    for (one, other), length in lengths.items():
        beside[place[one]].append((place[other], max(length, 1e-6)))
        beside[place[other]].append((place[one], max(length, 1e-6)))
    found = []
    for start in range(len(nodes)):
        reached: dict[int, float] = {}
        queue = [(0.0, start)]
        while queue:
            length, here = heapq.heappop(queue)
            if here not in reached:
                reached[here] = length
                for there, more in beside[here]:
                    heapq.heappush(queue, (length + more, there))
        found.append(reached)
    none = _APART * max(max(reached.values()) for reached in found) or 1.0
    return [[reached.get(other, none) for other in range(len(nodes))] for reached in found]


def _first_guess(far: list[list[float]]) -> list[Spot]:
    """By the ways to two pairs of far nodes; a little askew, so that no two nodes begin in one spot."""
    one = max(range(len(far)), key=lambda node: far[0][node])
    two = max(range(len(far)), key=lambda node: far[one][node])
    three = max(range(len(far)), key=lambda node: min(far[one][node], far[two][node]))
    four = max(range(len(far)), key=lambda node: far[three][node] + min(far[one][node], far[two][node]))
    skew = far[one][two] / 100
    return [
        (row[one] - row[two] + skew * cos(number), row[three] - row[four] + skew * sin(2.4 * number))
        for number, row in enumerate(far)
    ]


def _wanted(mine: int, spots: list[Spot], far: list[float]) -> Spot:
    """Where the pulls on one node meet."""
    x, y = spots[mine]
    sum_x = sum_y = weights = 0.0
    for number, (other_x, other_y) in enumerate(spots):
        if number == mine:
            continue
        rest = far[number]
        gap = hypot(x - other_x, y - other_y) or 1e-9
        weight = 1 / (rest * rest)
        sum_x += weight * (other_x + rest * (x - other_x) / gap)
        sum_y += weight * (other_y + rest * (y - other_y) / gap)
        weights += weight
    return sum_x / weights, sum_y / weights


def _level(spots: list[Spot]) -> list[Spot]:
    """Turned so that the direction of the widest spread is level (principal axes)."""
    count = len(spots)
    mean_x, mean_y = sum(x for x, _ in spots) / count, sum(y for _, y in spots) / count
    xx = sum((x - mean_x) ** 2 for x, _ in spots)
    yy = sum((y - mean_y) ** 2 for _, y in spots)
    xy = sum((x - mean_x) * (y - mean_y) for x, y in spots)
    angle = -atan2(2 * xy, xx - yy) / 2
    return [
        (
            (x - mean_x) * cos(angle) - (y - mean_y) * sin(angle),
            (x - mean_x) * sin(angle) + (y - mean_y) * cos(angle),
        )
        for x, y in spots
    ]


def _gap(one: Spot, other: Spot) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])

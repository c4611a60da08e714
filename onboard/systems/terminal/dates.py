"""Dates in a temporal network of lower bounds: the earliest of each is the longest way to it (rows M12 to M22)."""

from collections import deque
from typing import NamedTuple


class StepDate(NamedTuple):
    """One date: that at which step ``step`` of a machine's plan begins; for the number of steps, at which it ends."""

    owner: int
    step: int


class DateConstraint(NamedTuple):
    """``to`` is at least ``weight`` after ``origin``."""

    origin: StepDate
    to: StepDate
    weight: int


class Dates(NamedTuple):
    """Earliest dates of all nodes, and the machines whose plans contradict each other, so that there are none."""

    at: dict[StepDate, int]
    circle: frozenset[int]


def earliest(floors: dict[StepDate, int], edges: list[DateConstraint]) -> Dates:
    """Earliest dates: the longest way to each node from its floor, each edge looked at once (Kahn's order).

    Nodes that are on a circle, or behind one, keep their floors; their machines are named.
    """
    out: dict[StepDate, list[DateConstraint]] = {node: [] for node in floors}
    waiting = dict.fromkeys(floors, 0)
    for edge in edges:
        if edge.origin in out and edge.to in waiting:
            out[edge.origin].append(edge)
            waiting[edge.to] += 1
    at = dict(floors)
    ready = deque(node for node, count in waiting.items() if not count)
    done = 0
    while ready:
        node = ready.popleft()
        done += 1
        for edge in out[node]:
            at[edge.to] = max(at[edge.to], at[node] + edge.weight)
            waiting[edge.to] -= 1
            if not waiting[edge.to]:
                ready.append(edge.to)
    if done == len(floors):
        return Dates(at, frozenset())
    return Dates(at, frozenset(_on_circle(out, {node for node, count in waiting.items() if count})))


def _on_circle(out: dict[StepDate, list[DateConstraint]], left: set[StepDate]) -> set[int]:
    """Machines on circles: what is only behind one is taken away from its end, each edge looked at once."""
    behind: dict[StepDate, list[StepDate]] = {node: [] for node in left}
    ahead = dict.fromkeys(left, 0)
    for node in left:
        for edge in out[node]:
            if edge.to in ahead:
                behind[edge.to].append(node)
                ahead[node] += 1
    dead = [node for node, count in ahead.items() if not count]
    while dead:
        for node in behind[dead.pop()]:
            ahead[node] -= 1
            if not ahead[node]:
                dead.append(node)
    return {node.owner for node, count in ahead.items() if count}

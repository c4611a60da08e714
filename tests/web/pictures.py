"""How tests look at what a run looked like: in the page's film, and in the diagram over time."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from onboard.contract.messages import Message
from onboard.trace.chart.over_time import Rows
from onboard.trace.listener import LoggedMessage
from onboard.web.film import Film
from tests.web.logs import said_in

Snapshot = dict[str, Any]


def moments(film: Film, step_us: int) -> Iterator[tuple[int, Snapshot]]:
    """Snapshots of a whole film, one each ``step_us``."""
    for time_us in range(film.first_us, film.last_us, step_us):
        yield time_us, film.show(time_us).snapshot()


def last(said: list[tuple[int, bool, Message]], kind: type[Message], sender: int, time_us: int) -> Any:
    """The last message of a kind that a sender had said by then, None before the first."""
    return next(
        (one for at_us, _, one in reversed(said) if at_us <= time_us and type(one) is kind and one.sender == sender),
        None,
    )


def at(path: list[list[float]], time_us: int) -> tuple[float, float]:
    """Where the page draws a machine: the arithmetic of plan.js."""
    for (x0, y0, begin), (x1, y1, end) in pairwise(path):
        if time_us < end:
            share = max(0.0, min(1.0, (time_us - begin) / max(1, end - begin)))
            return x0 + (x1 - x0) * share, y0 + (y1 - y0) * share
    return path[-1][0], path[-1][1]


def watched(diagram: Rows, name: str) -> Rows:
    for time_us, is_fleet, message in said_in(name):
        if is_fleet:
            diagram.feed(LoggedMessage(time_us, "fleet", message, is_fleet))
    diagram.draw(0)
    return diagram


def points_of(diagram: Rows, node: int, panel: int = 0) -> set[tuple[int, float]]:
    return {point for line in diagram.panels[panel].lines if line.node == node for point in line.points}

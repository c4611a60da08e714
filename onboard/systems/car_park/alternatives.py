"""What a robot weighs before it bids, and what it bids with."""

from collections.abc import Iterable
from typing import NamedTuple

from onboard.core.site import Segment, Station
from onboard.systems.car_park.program import MAX_STEPS, CarStep


class Alternative(NamedTuple):
    """One solution that was weighed: the place chosen and when it would be finished (bus us), None where impossible.

    ``bound_us`` stands instead of the date where that was not worked out: it is no earlier than this, and so no better
    than the solution chosen.
    """

    station: Station
    finish_us: int | None
    bound_us: int | None = None


def weighed(alternatives: Iterable[Alternative]) -> str:
    """What was weighed, in words for the log: dates in bus time, s, and how many places were not worked out, or why."""
    told, bounded, blocked = [], 0, 0
    for station, finish_us, bound_us in alternatives:
        if finish_us is not None:
            told.append(f"{station} at {finish_us / 1e6:.3f}")
        elif bound_us is not None:
            bounded += 1
        else:
            blocked += 1
    return f"weighed: {', '.join(told)}; no sooner: {bounded}; out of reach: {blocked}"


class Solution(NamedTuple):
    """The operating sequence for one call: new steps after the ``kept`` ones, from ``origin`` at ``start_us``."""

    kept: int
    origin: Segment
    start_us: int
    steps: tuple[CarStep, ...]
    finish_us: int
    place: Station


def can_be_told(solution: Solution, before: Iterable[Solution]) -> bool:
    """Whether one itinerary can tell it with what may be won ``before`` it, whose ways back are then given up."""
    works = [[step.work is not None for step in one.steps] for one in before]
    steps = sum(len(one) - one[::-1].index(True) if True in one else len(one) for one in works)
    return solution.kept + steps + len(solution.steps) <= MAX_STEPS

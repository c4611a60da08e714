"""What was weighed before a bid was made, for the log and for comparisons."""

from collections.abc import Iterable
from typing import NamedTuple

from onboard.core.site import Station


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

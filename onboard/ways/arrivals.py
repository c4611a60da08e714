"""When a run may arrive where: worked out once for all runs that end alike, from wherever they come."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from onboard.core.site import Segment
from onboard.ways.departures import Departures


class Safe(Protocol):
    """A safe interval ``[from_us, to_us)`` for standing, and its number."""

    number: int
    from_us: int
    to_us: int


class Arriving(NamedTuple):
    """Windows ``[from_us, to_us)`` of arrivals in order, each with the number of the safe interval; and their ends."""

    windows: list[tuple[int, int, int]]
    lates_us: list[int]


class Arrivals(dict[tuple[Segment, int], Arriving]):
    """Of the runs to positions, by the position and how they end (``Roads.tails``); worked out when asked for."""

    def __init__(self, departures: Departures, states: Callable[[Segment], Sequence[Safe]]) -> None:
        super().__init__()
        self._departures, self._states = departures, states

    def __missing__(self, key: tuple[Segment, int]) -> Arriving:
        forbidden = self._forbidden(*key)
        found: list[tuple[int, int, int]] = []
        place, count = 0, len(forbidden)
        for state in self._states(key[0]):
            from_us, to_us = state.from_us, state.to_us
            while place < count and forbidden[place][0] < to_us and from_us < to_us:
                last_us, next_us = forbidden[place]
                if from_us <= last_us and from_us < next_us:
                    found.append((from_us, last_us + 1, state.number))
                from_us = max(from_us, next_us)
                place += next_us < to_us
            if from_us < to_us:
                found.append((from_us, to_us, state.number))
        arriving = self[key] = Arriving(found, [late_us for _, late_us, _ in found])
        return arriving

    def _forbidden(self, there: Segment, tail: int) -> list[tuple[int, int]]:
        """Arrivals that others forbid, in order: all between the last one before and the next one behind."""
        roads, departures = self._departures.roads, self._departures
        found: list[tuple[int, int]] = []
        held = departures.held_on(there.track)
        if not held and roads.lift_at(there) is None:
            return found
        step, sweeps = roads.tails[tail]
        for offset, enter_us, leave_us in sweeps:
            windows = held.get(there.index + step * offset)
            if offset == 0 and roads.lift_at(there) is not None:
                # It crosses the sill while the platform is there.
                windows = departures.held(there)
            if windows is not None:
                found += [(begin_us - leave_us, end_us - enter_us) for begin_us, end_us in zip(*windows, strict=True)]
        found.sort()
        return found

"""When a run may arrive where: worked out once for all runs that end alike, from wherever they come."""

from onboard.core.site import Segment
from onboard.ways.departures import Departures
from onboard.ways.kinematics import ceil_ms
from onboard.ways.reservations import FOREVER
from onboard.ways.states import States

#: Windows of arrivals in order: their begins, from a whole millisecond on as runs take whole ones, their ends, and the
#: numbers of the safe intervals in which they are. Plain tuples of integers, as few as can be: what refers to nothing
#: else the collector of garbage leaves alone, but it looks at each once.
Arriving = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]
#: A key is index | tail << ``TAIL_SHIFT``: indices on the wire are bytes, and a platform may be behind the last.
TAIL_SHIFT = 9
INDEX_MASK = (1 << TAIL_SHIFT) - 1
#: Behind all that is forbidden: no safe interval ends later.
_NEVER = FOREVER, FOREVER


class Arrivals(dict[int, Arriving]):
    """Of the runs along a track, by where and how they end: ``key``; worked out when asked for."""

    def __init__(self, departures: Departures, states: States, track: int) -> None:
        super().__init__()
        self._departures, self._states, self._track = departures, states, track
        self._held = departures.held_on(track)

    def __missing__(self, key: int) -> Arriving:
        there = Segment(self._track, key & INDEX_MASK)
        forbidden = self._forbidden(there, key >> TAIL_SHIFT)
        forbidden.append(_NEVER)
        firsts_us: list[int] = []
        lates_us: list[int] = []
        numbers: list[int] = []
        place, (last_us, next_us) = 0, forbidden[0]
        for state in self._states[there]:
            number, to_us = state.number, state.to_us
            from_us = ceil_ms(state.from_us)
            while last_us < to_us:
                if from_us <= last_us and from_us < next_us:
                    firsts_us.append(from_us)
                    lates_us.append(last_us + 1)
                    numbers.append(number)
                if from_us < next_us:
                    from_us = ceil_ms(next_us)
                if next_us >= to_us:
                    break
                place += 1
                last_us, next_us = forbidden[place]
            if from_us < to_us:
                firsts_us.append(from_us)
                lates_us.append(to_us)
                numbers.append(number)
        arriving = self[key] = tuple(firsts_us), tuple(lates_us), tuple(numbers)
        return arriving

    def _forbidden(self, there: Segment, tail: int) -> list[tuple[int, int]]:
        """Arrivals that others forbid, in order: all between the last one before and the next one behind."""
        found: list[tuple[int, int]] = []
        roads, held = self._departures.roads, self._held
        is_aboard = roads.lift_at(there) is not None
        if not held and not is_aboard:
            return found
        (step, sweeps), index = roads.tails[tail], there.index
        for offset, enter_us, leave_us in sweeps:
            # It crosses the sill of a lift while the platform is there.
            windows = self._departures.held(there) if is_aboard and not offset else held.get(index + step * offset)
            if windows is not None:
                begins, ends = windows
                found += [
                    (begin_us - leave_us, end_us - enter_us) for begin_us, end_us in zip(begins, ends, strict=True)
                ]
        found.sort()
        return found

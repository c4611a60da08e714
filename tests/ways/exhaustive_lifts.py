"""The exhaustive search of ``exhaustive.py`` for several floors and lifts: again it shares only the problem.

The lifts have the carrier's axis and floors as far apart as segments, so a run over n floors takes 2n + 2 ticks; a ride
takes ``GATE`` more. What a lift can do is checked where somebody crosses its sill: boarding, whether it could come from
where the one before left it; leaving, whether it can go where the next one waits. While somebody is aboard, nobody else
may use it. Places are (floor, index); index 0 and ``length`` + 1 are the platforms of the left and the right lift.
"""

from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

from tests.ways.exhaustive import _BITS, HORIZON, Place, _crossing

GATE = 1
EVER = (1 << _BITS) - 1


class Ridden(NamedTuple):
    """Somebody's use of the left (0) or right (1) lift in ticks; ``until`` None for ever."""

    lift: int
    board: int
    leave: int
    begin: int
    until: int | None


@dataclass(frozen=True)
class Building:
    """One query in ticks; ``lifts`` are those that exist, ``standing`` their floors at the start."""

    floors: int
    length: int
    lifts: tuple[int, ...]
    half_body: int
    held: tuple[tuple[Place, int, int | None], ...]
    uses: tuple[Ridden, ...]
    standing: tuple[int, int]
    start: Place
    start_tick: int
    visits: tuple[tuple[Place, int, int], ...]
    refuges: frozenset[Place]

    def places(self) -> list[Place]:
        """Everywhere where a carrier can stand."""
        indices = [*range(1, self.length + 1), *(0 if lift == 0 else self.length + 1 for lift in self.lifts)]
        return list(product(range(1, self.floors + 1), indices))

    def lift_at(self, place: Place) -> int | None:
        """The lift whose platform a place is."""
        return {0: 0, self.length + 1: 1}.get(place[1])


def empty_run(floors: int) -> int:
    """Ticks of a lift's run."""
    return 2 * abs(floors) + 2 if floors else 0


@dataclass
class ExhaustiveLifts:
    """All plans of one building."""

    problem: Building
    free: dict[Place, int] = field(default_factory=dict)
    stand: dict[Place, int] = field(default_factory=dict)
    moves: dict[Place, list[tuple[Place, int, int]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        problem = self.problem
        for place in problem.places():
            self.free[place] = EVER
        for place, begin, end in problem.held:
            self.free[place] &= ~_ticks(begin, end)
        self.quiet = [EVER, EVER]
        for use in problem.uses:
            self.quiet[use.lift] &= ~_ticks(use.begin, use.until)
        for place in problem.places():
            lift = problem.lift_at(place)
            self.stand[place] = EVER if lift is None else self.quiet[lift]
            for touched in self.touched(place):
                self.stand[place] &= self.free[touched]
        for here, there in product(problem.places(), problem.places()):
            if here != there and here[0] == there[0]:
                self.add_run(here, there)
            lift = problem.lift_at(here)
            if lift is not None and lift == problem.lift_at(there) and here != there:
                duration = empty_run(there[0] - here[0]) + GATE
                self.moves.setdefault(here, []).append((there, duration, _during(self.quiet[lift], 0, duration)))

    def touched(self, place: Place) -> list[Place]:
        """Segments that a standing body overlaps, but no platform."""
        return [
            (place[0], other)
            for other in range(1, self.problem.length + 1)
            if 2 * abs(other - place[1]) - 1 < self.problem.half_body
        ]

    def add_run(self, here: Place, there: Place) -> None:
        """A run with the departures from which all windows are free."""
        n, half = abs(there[1] - here[1]), self.problem.half_body
        allowed = (1 << HORIZON) - 1
        for index in range(1, self.problem.length + 1):
            ahead = (index - here[1]) * (1 if there[1] > here[1] else -1)
            near, far = 2 * ahead - 1 - half, 2 * ahead + 1 + half
            if near < 2 * n and far > 0:
                allowed &= _during(self.free[here[0], index], _crossing(near, n), _crossing(far, n))
        out, into = self.problem.lift_at(here), self.problem.lift_at(there)
        if out is not None:
            gone = _crossing(1 + half, n)
            may_leave = sum(1 << tick for tick in range(_BITS) if self.can_leave(out, here[0], tick))
            allowed &= _during(self.quiet[out], 0, gone) & may_leave >> gone
        if into is not None:
            entering = _crossing(2 * n - 1 - half, n)
            may_board = sum(1 << tick for tick in range(_BITS) if self.can_board(into, there[0], tick))
            allowed &= _during(self.quiet[into], entering, 2 * n + 2) & may_board >> entering
        self.moves.setdefault(here, []).append((there, 2 * n + 2, allowed))

    def can_board(self, lift: int, floor: int, tick: int) -> bool:
        """Whether the lift can be at a floor when somebody enters it."""
        before = [use for use in self.problem.uses if use.lift == lift and use.until is not None and use.until <= tick]
        before = [use for use in before if use.until is not None and use.until > self.problem.start_tick]
        last = max(before, key=lambda use: use.until or 0, default=None)
        if last is None or last.until is None:
            return self.problem.start_tick + empty_run(floor - self.problem.standing[lift]) <= tick
        return last.until + empty_run(floor - last.leave) <= tick

    def can_leave(self, lift: int, floor: int, tick: int) -> bool:
        """Whether the lift, left at a floor, can be where the next one boards."""
        after = [use for use in self.problem.uses if use.lift == lift and use.begin >= tick]
        following = min(after, key=lambda use: use.begin, default=None)
        return following is None or tick + empty_run(following.board - floor) <= following.begin

    def spread(self, place: Place, times: int) -> dict[Place, int]:
        """All (place, tick) at which one can be at rest, having been at ``place`` at any of ``times``.

        Who has driven onto a platform rides before it drives off: a lift comes for nothing else.
        """
        at, boarded = dict.fromkeys(self.stand, 0), dict.fromkeys(self.stand, 0)
        at[place] = times
        for tick in range(HORIZON):
            for here in at:
                for rested, is_to_ride in ((at, False), (boarded, True)):
                    if not (rested[here] & self.stand[here]) >> tick & 1:
                        continue
                    rested[here] |= 1 << (tick + 1)
                    for there, duration, allowed in self.moves.get(here, ()):
                        rides = there[0] != here[0]
                        if allowed >> tick & 1 and (rides or not is_to_ride):
                            enters = self.problem.lift_at(there) is not None and not rides
                            (boarded if enters else at)[there] |= 1 << (tick + duration)
        return {here: at[here] | boarded[here] for here in at}

    def dwells(self, at: int, visit: tuple[Place, int, int]) -> int:
        """All ends of a dwell for a body that can be there at the ticks ``at``."""
        place, dwell, not_before = visit
        begins = at & self.stand[place] & ~((1 << not_before) - 1)
        return (begins & _during(self.stand[place], 0, dwell)) << dwell & ((1 << HORIZON) - 1)

    def rest(self, place: Place, times: int) -> int | None:
        """The earliest rest for ever in a refuge, having been at ``place`` at one of ``times``."""
        at = self.spread(place, times)
        rests = [
            tick
            for refuge in self.problem.refuges
            for tick in range(HORIZON)
            if at[refuge] >> tick & 1 and self.stand[refuge] >> tick == EVER >> tick
        ]
        return min(rests, default=None)

    def solve(self) -> tuple[int, int] | None:
        """(end of the last visit, arrival in the refuge) in ticks, the least there is; None where there is no plan."""
        place, times = self.problem.start, 1 << self.problem.start_tick
        if not self.stand[place] >> self.problem.start_tick & 1:
            return None
        for visit in self.problem.visits:
            times = self.dwells(self.spread(place, times)[visit[0]], visit)
            place = visit[0]
        rest = self.rest(place, times)
        if rest is None or not self.problem.visits:
            return None if rest is None else (rest, rest)
        for end in range(HORIZON):
            if times >> end & 1:
                rest = self.rest(place, 1 << end)
                if rest is not None:
                    return end, rest
        raise AssertionError("some end leads to a refuge, but none does")


def _ticks(begin: int, end: int | None) -> int:
    """Bits of ``[begin, end)``."""
    return ((1 << ((_BITS if end is None else end) - begin)) - 1) << begin


def _during(free: int, begin: int, end: int) -> int:
    """Departures after which all ticks ``[begin, end)`` are free."""
    allowed = EVER
    for tick in range(begin, end):
        allowed &= free >> tick
    return allowed

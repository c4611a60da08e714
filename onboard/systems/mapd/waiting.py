"""Where a robot without a task waits: where, with all others where they are or will be, the next call is nearest.

The expected way to the next pick-up, all endpoints alike, goes by the sum over endpoints of the steps from whoever is
nearest (the p-median of Hakimi 1964). A robot goes where that falls most, if by enough. As each looks at what those
before it have published, the sum falls with every move, so this comes to an end.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from onboard.systems.mapd.floor import Floor

#: Endpoints that are looked at, evenly out of all: enough to know one corner of the floor from another.
MOST_ENDS = 60
#: A waiting place is at most so many steps from the one before: from there it may go on.
MOST_STEPS = 6
#: Robots and endpoints that are farther off than this, steps, have nothing to do with it.
RANGE = 15
#: The expected way to a pick-up has to become shorter by so many hundredths of a step.
WORTH = 10


@dataclass
class WaitingPlaces:
    """One robot's view of ``ends``; what it found last stands until another goes elsewhere, or begins or ends work."""

    floor: Floor
    ends: Sequence[int]
    _seen: tuple[object, ...] = ()
    _found: int | None = None

    def __post_init__(self) -> None:
        self.ends = self.ends[:: max(1, -(-len(self.ends) // MOST_ENDS))]

    def better(self, here: int, others: Sequence[tuple[int, int, bool]], free: Collection[int]) -> int | None:
        """Cell of ``free`` that is better than ``here``; None where there is none.

        ``others`` are cell, steps until there, and whether it works until then.
        """
        back = self.floor.steps_to(here)
        near = tuple(one for one in others if back[one[0]] <= RANGE)
        seen = (here, *((cell, works) for cell, _, works in near))
        if seen != self._seen:
            self._seen, self._found = seen, self._look(here, near, free)
        return self._found if self._found in free else None

    def _look(self, here: int, others: Sequence[tuple[int, int, bool]], free: Collection[int]) -> int | None:
        steps_to = self.floor.steps_to
        back = steps_to(here)
        ways = []
        for end in self.ends:
            if back[end] <= RANGE:
                steps = steps_to(end)
                ways.append((steps, min((wait + steps[cell] for cell, wait, _ in others), default=RANGE)))

        def sum_of(cell: int) -> int:
            return sum([min(steps[cell], nearest) for steps, nearest in ways])

        taken = {cell for cell, _, _ in others}
        near = [cell for cell in sorted(free) if back[cell] <= MOST_STEPS and cell not in taken]
        least, found = min(((sum_of(cell), cell) for cell in near), default=(0, here))
        return found if near and 100 * (sum_of(here) - least) >= WORTH * len(self.ends) else None

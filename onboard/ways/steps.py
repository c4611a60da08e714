"""Moves of machines that go from place to place in steps, all at once: what the search needs of such a floor.

Places are numbers of a network whose ways all cost one step; place n is segment (``FLOOR``, n), and a step is
``STEP_US`` of the reservations. Whoever is at a place at step s has it during [s, s + 1). One may come to a place in
the step in which another leaves it, but never in a ring in which each follows the next: nobody of it could be the first
to begin, as each enters once the one before has begun to leave. With one other that is to change places.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import cache

from onboard.core.site import Segment
from onboard.ways.network import Network
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow
from onboard.ways.states import Edge, State, number_on

#: One step, as reservations count time: a whole millisecond.
STEP_US = 1_000
#: Steps to where no way leads; above every real distance.
FAR = 1 << 20
#: The track that stands for a floor.
FLOOR = 1


@cache
def cell_segment(cell: int) -> Segment:
    """The segment that stands for a place, or for what standing there takes: made once for each place of a site."""
    return Segment(FLOOR, cell)


def path_windows(network: Network[int], start: int, cells: Iterable[int]) -> list[SlotWindow]:
    """What a path takes from step ``start`` on, a cell a step and the last one for ever."""
    found: list[SlotWindow] = []
    since, last = start, -1
    for step, cell in enumerate(cells, start):
        taken = network.takes.get(cell, cell)
        if taken != last and step > start:
            found.append(SlotWindow(cell_segment(last), since * STEP_US, step * STEP_US))
            since = step
        last = taken
    return [*found, SlotWindow(cell_segment(last), since * STEP_US, FOREVER)]


class StepTimes:
    """Least times to some goals, from the steps."""

    def __init__(self, steps: Sequence[int]) -> None:
        self._steps = steps

    def to_us(self, origin: Segment) -> int:
        """Least time from a cell; FOREVER without a way."""
        steps = self._steps[origin.index]
        return steps * STEP_US if steps < FAR else FOREVER


class StepGround:
    """Least times on a floor, from the steps from each cell to one goal, or to any of some."""

    def __init__(
        self, steps_to: Callable[[int], Sequence[int]], steps_to_any: Callable[[Iterable[int]], Sequence[int]]
    ) -> None:
        self._steps_to, self._steps_to_any = steps_to, steps_to_any

    def ways_us(self, goals: frozenset[Segment]) -> StepTimes:
        """Least times to any of ``goals``."""
        cells = [goal.index for goal in goals]
        return StepTimes(self._steps_to(*cells) if len(cells) == 1 else self._steps_to_any(cells))

    def shortest_us(self, origin: Segment, goal: Segment) -> int:
        """Least time between two cells; FOREVER without a way."""
        return self.ways_us(frozenset((goal,))).to_us(origin)

    def lift_at(self, position: Segment) -> None:
        """No cell is a platform."""


class StepMoves:
    """States and moves around the reservations of all but ``owner``, from step ``start`` on.

    ``goes_round(holder, cell, step)`` says whether ``holder``, or one that it follows in this step, moves to what
    ``cell`` takes; it is asked of who leaves the place that one goes to in the very same step.
    """

    def __init__(
        self,
        network: Network[int],
        reservations: Reservations,
        owner: int,
        start: int,
        goes_round: Callable[[int, int, int], bool],
    ) -> None:
        self.numbered: list[State] = []
        self._network, self._reservations, self._owner = network, reservations, owner
        self._start_us, self._goes_round = start * STEP_US, goes_round
        self._states: dict[Segment, list[State]] = {}

    def states(self, segment: Segment) -> list[State]:
        """The safe intervals for standing in a cell, in order."""
        found = self._states.get(segment)
        if found is None:
            taken = cell_segment(self._network.takes.get(segment.index, segment.index))
            safe = self._reservations.safe_intervals(taken, self._owner, self._start_us)
            found = self._states[segment] = number_on(self.numbered, segment, safe)
        return found

    def state_at(self, segment: Segment, time_us: int) -> State | None:
        """The state of standing in a cell at a time, or None."""
        return next((one for one in self.states(segment) if one.from_us <= time_us < one.to_us), None)

    def edges(self, state: State, from_us: int) -> list[Edge]:
        """Steps to the cells beside a state's, all of them sure."""
        if state.edges is None:
            # Once for all departures: there are few.
            found: list[Edge] = []
            here = state.segment.index
            for to, _ in self._network.ways[here]:
                for there in self.states(cell_segment(to)):
                    first_us = max(state.from_us, there.from_us - STEP_US)
                    if first_us == there.from_us - STEP_US and self._is_in_ring(here, to, first_us):
                        first_us += STEP_US
                    last_us = min(state.to_us, there.to_us - STEP_US)
                    if first_us < last_us:
                        found.append((first_us, last_us, FOREVER, STEP_US, there.number, 1, True))
            state.edges = found
        return state.edges

    def _is_in_ring(self, here: int, to: int, depart_us: int) -> bool:
        taken, arrive_us = cell_segment(self._network.takes.get(to, to)), depart_us + STEP_US
        for start_us, end_us, holder in self._reservations.on(taken):
            is_there = holder != self._owner and start_us < arrive_us and depart_us < end_us
            if is_there and self._goes_round(holder, here, depart_us // STEP_US):
                return True
        return False

    def to_goals(self, state: State, goals: frozenset[Segment]) -> list[Edge]:
        """None: a goal is a cell like others."""
        return []

    def looked_at(self, here: State, edge: Edge) -> list[Edge]:
        """None: no move is a bound."""
        return []

"""The search through all interleavings: which task sets have a timing that sticks, and the shortest one."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations, permutations
from typing import NamedTuple

from bus_sim.systems.graph.certify.model import GraphModel, ModelMove, State
from onboard.systems.graph.network import Graph


class TaskSet(NamedTuple):
    """Where robots stand at first and where they are to go: all starts differ, all goals, and each from its start."""

    starts: tuple[int, ...]
    goals: tuple[int, ...]

    def __str__(self) -> str:
        return ", ".join(f"R{n} N{a} to N{b}" for n, (a, b) in enumerate(zip(*self, strict=True), start=1))


def task_sets(graph: Graph, robots: int) -> Iterator[TaskSet]:
    """Every task set; which robot of the set has which task does not matter."""
    for starts in combinations(graph.nodes, robots):
        for goals in permutations(graph.nodes, robots):
            if all(one != other for one, other in zip(starts, goals, strict=True)):
                yield TaskSet(starts, goals)


class Stuck(NamedTuple):
    """A timing of a task set after which nobody can move: the moves, and the state at the end."""

    tasks: TaskSet
    moves: tuple[ModelMove, ...]
    state: State


class TooLargeError(Exception):
    """The search came to its limit of states."""


@dataclass
class DeadlockSearch:
    """Remembers of every state that it saw whether it can stick, so that task sets share their futures.

    ``limit`` is the most states that are remembered. Raises ``TooLargeError`` beyond.
    """

    model: GraphModel
    limit: int = 20_000_000
    known: dict[State, bool] = field(default_factory=dict)

    def can_stick(self, tasks: TaskSet) -> bool:
        """Whether some interleaving of a task set ends where nobody can move and not all have arrived."""
        first: State = tuple(sorted(self.model.start(*tasks)))
        if first in self.known:
            return self.known[first]
        before: dict[State, State | None] = {first: None}
        open_states = [first]
        while open_states:
            state = open_states.pop()
            judged = self.known.get(state)
            if judged is False:
                continue
            after = [] if judged else self.model.moves(state)
            if judged or (not after and not self.model.is_over(state)):
                self._remember_way(state, before)
                return True
            for _, following in after:
                ordered: State = tuple(sorted(following))
                if ordered not in before:
                    before[ordered] = state
                    open_states.append(ordered)
            if len(before) + len(self.known) > self.limit:
                raise TooLargeError(f"more than {self.limit} states")
        self.known.update(dict.fromkeys(before, False))
        return False

    def _remember_way(self, state: State | None, before: dict[State, State | None]) -> None:
        while state is not None:
            self.known[state] = True
            state = before[state]

    def counterexample(self, tasks: TaskSet) -> Stuck | None:
        """A shortest timing that sticks, robots by their numbers; None where there is none."""
        first = self.model.start(*tasks)
        before: dict[State, tuple[State, ModelMove] | None] = {first: None}
        queue = deque([first])
        while queue:
            state = queue.popleft()
            after = self.model.moves(state)
            if not after and not self.model.is_over(state):
                return Stuck(tasks, self._moves_to(state, before), state)
            for move, following in after:
                if following not in before:
                    before[following] = (state, move)
                    queue.append(following)
        return None

    def _moves_to(self, state: State, before: dict[State, tuple[State, ModelMove] | None]) -> tuple[ModelMove, ...]:
        moves: list[ModelMove] = []
        while (step := before[state]) is not None:
            state, move = step
            moves.append(move)
        return tuple(reversed(moves))

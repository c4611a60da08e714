"""Who plans in a step, after whom and for what: the changes that the round brought, and its awards."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from onboard.contract.mapd import PathHead, StepTurn
from onboard.contract.messages import Award
from onboard.systems.mapd.calls import is_of_step
from onboard.systems.mapd.fields import NO_TASK


@dataclass
class Turns:
    """The turns and awards of one step, until all of them were heard."""

    step: int
    turns: dict[int, StepTurn] = field(default_factory=dict)
    won: dict[int, int] = field(default_factory=dict)
    #: Robots in the order of their turns, None where a turn was heard since; who of them has won.
    _order: list[int] | None = None
    _winners: set[int] = field(default_factory=set)
    #: How many of them, first ones first, have told their paths.
    _planned: int = 0

    def hear(self, turn: StepTurn) -> None:
        """One turn, in any order, also twice; others' steps are passed over."""
        if turn.step == self.step and self.turns.get(turn.index) != turn:
            self.turns[turn.index] = turn
            self._order, self._planned = None, 0

    def on_award(self, award: Award) -> bool:
        """An award, said before or after the turn; True where it is of this step."""
        if not is_of_step(award, self.step):
            return False
        self.won[award.winner] = award.task.number
        return True

    @property
    def is_complete(self) -> bool:
        """Whether all changes of the step are known."""
        first = next(iter(self.turns.values()), None)
        if first is None or len(self.turns) < max(1, first.changes):
            return False
        return all(turn.robot in self.won for turn in self.turns.values() if turn.won)

    def next_to_plan(self, heads: Mapping[int, PathHead]) -> int:
        """The first robot that has not told a path of this step, by the ``heads`` of all paths; 0 where all have."""
        order = self._in_order()
        while self._planned < len(order):
            robot = order[self._planned]
            head = heads.get(robot)
            if head is None or head.step != self.step or not head.version:
                return robot
            self._planned += 1
        return 0

    def takes(self, robot: int) -> int:
        """The task that a robot has won in this step, ``NO_TASK`` for none."""
        self._in_order()
        return self.won.get(robot, NO_TASK) if robot in self._winners else NO_TASK

    def _in_order(self) -> list[int]:
        if self._order is None:
            self._order = [turn.robot for _, turn in sorted(self.turns.items()) if turn.robot]
            self._winners = {turn.robot for turn in self.turns.values() if turn.won}
        return self._order

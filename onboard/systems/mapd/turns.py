"""Who plans in a step, after whom and for what: the changes that the round brought, and its awards."""

from dataclasses import dataclass, field

from onboard.contract.mapd import StepTurn
from onboard.contract.messages import Award
from onboard.systems.mapd.calls import is_of_step
from onboard.systems.mapd.fields import NO_TASK


@dataclass
class Turns:
    """The turns and awards of one step, until all of them were heard."""

    step: int
    turns: dict[int, StepTurn] = field(default_factory=dict)
    won: dict[int, int] = field(default_factory=dict)

    def hear(self, turn: StepTurn) -> None:
        """One turn, in any order, also twice; others' steps are passed over."""
        if turn.step == self.step:
            self.turns[turn.index] = turn

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

    @property
    def order(self) -> list[int]:
        """Robots that plan, first ones first."""
        return [turn.robot for _, turn in sorted(self.turns.items()) if turn.robot]

    def takes(self, robot: int) -> int:
        """The task that a robot has won in this step, ``NO_TASK`` for none."""
        has_won = any(turn.won for turn in self.turns.values() if turn.robot == robot)
        return self.won.get(robot, NO_TASK) if has_won else NO_TASK

"""Who plans in a step, and after whom: the changes that the round brought, in the order of their awards."""

from dataclasses import dataclass, field

from onboard.systems.mapd.messages import NO_TASK, StepAward


@dataclass
class Turns:
    """The awards of one step, until all of them were heard."""

    step: int
    awards: dict[int, StepAward] = field(default_factory=dict)

    def hear(self, award: StepAward) -> None:
        """One award, in any order, also twice; others' steps are passed over."""
        if award.step == self.step:
            self.awards[award.index] = award

    @property
    def is_complete(self) -> bool:
        """Whether all changes of the step are known."""
        first = next(iter(self.awards.values()), None)
        return first is not None and len(self.awards) >= max(1, first.changes)

    @property
    def order(self) -> list[int]:
        """Robots that plan, first ones first."""
        return [award.robot for _, award in sorted(self.awards.items()) if award.robot]

    def takes(self, robot: int) -> int:
        """The task that a robot has won in this step, ``NO_TASK`` for none."""
        return next((award.task for award in self.awards.values() if award.robot == robot), NO_TASK)

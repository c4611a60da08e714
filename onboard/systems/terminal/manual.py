"""A vehicle held by a person (row M38) may also be let carry out one elementary action of its plan at a time.

That step is the next one of its plan, and it too needs its rights: a person's order permits nothing by itself.
"""

from dataclasses import dataclass

from onboard.contract.codes import ManualMode
from onboard.contract.messages import ManualOrder
from onboard.core.effects import Effect
from onboard.systems.terminal.traffic import Owned
from onboard.work import manual


@dataclass
class VehicleMode(manual.Manual):
    """One vehicle's mode. ``allowed`` are plan version and step of a step by hand."""

    allowed: tuple[int, int] | None = None

    def step_by_hand(self, order: ManualOrder, owned: Owned | None) -> list[Effect]:
        """A person's order; said again it is only answered again."""
        effects = self.take(order)
        if effects:
            step = order.manual_mode is ManualMode.STEP and owned is not None
            self.allowed = (owned.plan.version, owned.current) if step and owned is not None else None
        return effects or [self.report()]

    def may_begin(self, owned: Owned) -> bool:
        """Whether something may be begun for the step in hand; a step by hand that is over holds the vehicle again."""
        if self.mode is ManualMode.AUTOMATIC:
            return True
        return self.mode is ManualMode.STEP and self.allowed == (owned.plan.version, owned.current)

"""What each machine will do: its firm itinerary, and the leg of it that it is at."""

from dataclasses import dataclass

from onboard.contract.codes import Grade
from onboard.contract.messages import Itinerary, Leg, Progress


@dataclass(frozen=True, slots=True)
class PlanTold:
    """An itinerary; ``before`` is the firm one that its sender told last."""

    plan: Itinerary
    before: Itinerary | None

    @property
    def is_firm(self) -> bool:
        """Whether it will be done; else it is what a bid offers."""
        return self.plan.grade is Grade.FIRM


class Plans:
    """A fold over itineraries and progress, by node-ID."""

    def __init__(self) -> None:
        self.firm: dict[int, Itinerary] = {}
        self._legs: dict[int, int] = {}

    def ahead(self, node: int) -> tuple[Leg, ...]:
        """The legs of a machine's firm plan from the one in hand on; none where it has told no plan."""
        plan = self.firm.get(node)
        return plan.legs[self._legs[node] :] if plan is not None else ()

    def on_itinerary(self, plan: Itinerary) -> PlanTold:
        """A firm plan replaces the one before; a tentative one changes nothing."""
        fact = PlanTold(plan, self.firm.get(plan.sender))
        if fact.is_firm:
            self.firm[plan.sender] = plan
            self._legs[plan.sender] = 0
        return fact

    def on_progress(self, progress: Progress) -> None:
        """How far a plan has come; a word about an older plan says nothing of this one."""
        plan = self.firm.get(progress.sender)
        if plan is not None and plan.version == progress.itinerary_version:
            self._legs[progress.sender] = progress.leg

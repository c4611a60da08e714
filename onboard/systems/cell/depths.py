"""Whose goals would need deeper sub-goals than their managers let robots call for: one robot says so for all."""

from dataclasses import dataclass, field

from onboard.contract.cell import GoalTooDeep
from onboard.contract.messages import CallForProposals, Message, Reference

#: Parts of which is remembered that they were told of.
MAX_TOLD = 256


@dataclass
class Depths:
    """Parts that one robot could bring on, if it could call for one more sub-goal. ``due`` are those to be told."""

    due: set[Reference] = field(default_factory=set)
    #: The newest of those that were told, as keys; the oldest go first.
    _told: dict[Reference, None] = field(default_factory=dict)

    def reach(self, part: Reference) -> None:
        """Its sub-goal would be too deep: to be told once for each call of the part's manager."""
        if part not in self._told:
            self.due.add(part)

    def hear(self, message: Message) -> None:
        """What another has told needs no second word; a manager's next call does."""
        match message:
            case GoalTooDeep(part=part):
                self._note(part)
                self.due.discard(part)
            case CallForProposals(depth=0, car=part):
                self._told.pop(part, None)

    def take(self) -> list[Reference]:
        """The parts that are to be told now; they count as told."""
        parts = sorted(self.due)
        for part in parts:
            self._note(part)
        self.due.clear()
        return parts

    def _note(self, part: Reference) -> None:
        self._told[part] = None
        if len(self._told) > MAX_TOLD:
            del self._told[next(iter(self._told))]

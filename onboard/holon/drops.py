"""What a machine tells of the input that it dropped: ``Diagnostic``, so that the bus itself shows it."""

from collections import Counter
from dataclasses import dataclass, field

from onboard.contract.codes import Reason
from onboard.contract.messages import Diagnostic
from onboard.core.effects import Effect, Send


@dataclass
class ToldDrops:
    """Counts as they were last told, by reason."""

    _told: Counter[Reason] = field(default_factory=Counter)

    def words(self, sender: int, totals: Counter[Reason]) -> list[Effect]:
        """One message for each reason whose count has grown since it was told."""
        grown = [reason for reason in sorted(totals) if totals[reason] != self._told[reason]]
        self._told = totals
        return [Send(Diagnostic(sender, reason, totals[reason] & 0xFFFFFFFF)) for reason in grown]

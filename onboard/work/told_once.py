"""What waits for a person: the operator is told of each when it begins to, and not again before it has ended."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.core.effects import Effect, Report


@dataclass
class ToldOnce:
    """What was told to wait and waits still."""

    _told: set[str] = field(default_factory=set)

    def news(self, waiting: Iterable[tuple[str, str]]) -> list[Effect]:
        """``waiting`` is all that waits now, and why; what was not told of before."""
        why, known = dict(waiting), self._told
        self._told = set(why)
        return [Report(f"{what} waits: {why[what]}") for what in sorted(self._told - known)]

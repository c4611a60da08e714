"""What a robot of a graph keeps beside the core's mirror: how often its clock was set."""

from dataclasses import dataclass
from typing import ClassVar

from onboard.core.behaviour import Fleet
from onboard.core.mirror import Mirror


@dataclass
class ClockedMirror(Mirror):
    """Counts how often bus time was set here, and not slewed: how much of a time is over nobody knows then."""

    clock_sets: int = 0

    def retime(self, now_us: int) -> None:
        """Bus time was set to ``now_us``."""
        super().retime(now_us)
        self.clock_sets += 1


@dataclass
class ClockedFleet(Fleet):
    """What the core lends to a robot that counts a time by itself."""

    mirror_type: ClassVar[type[Mirror]] = ClockedMirror

    @property
    def clock_sets(self) -> int:
        """How often bus time was set here."""
        assert isinstance(self.mirror, ClockedMirror)
        return self.mirror.clock_sets

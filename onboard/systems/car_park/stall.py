"""A drive that does not do what it is told: its machine is an obstacle until it moves (issue 4, point 3)."""

from dataclasses import dataclass

from onboard.core.behaviour import NEVER_US

#: A drive that has orders and has not moved for so long is stuck, us: brakes and locks take less.
STALL_US = 8_000_000


@dataclass
class Stall:
    """Watches one drive; all times in us of one clock."""

    _since_us: int | None = None
    _position_mm: int | None = None

    def ordered(self, now_us: int) -> None:
        """The drive has an order to go on."""
        if self._since_us is None:
            self._since_us = now_us

    def rests(self) -> None:
        """Nothing is asked of the drive."""
        self._since_us = None

    def sensed(self, position_mm: int, now_us: int) -> None:
        """Where the drive is; any motion shows that it works."""
        if position_mm != self._position_mm and self._since_us is not None:
            self._since_us = now_us
        self._position_mm = position_mm

    @property
    def stuck_from_us(self) -> int:
        """From when on the drive has not moved for too long though it was told to."""
        return NEVER_US if self._since_us is None else self._since_us + STALL_US

    def is_stuck(self, now_us: int) -> bool:
        """Whether it has not by now."""
        return self._since_us is not None and now_us - self._since_us >= STALL_US

"""What the words of a drive come to: whether it does what it is told, and when its place is told to the others.

One that does not makes its machine an obstacle until it moves (issue 4, point 3).
"""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

from onboard.contract.codes import DriveMode
from onboard.core.behaviour import NEVER_US

#: A drive that has orders and has not moved for so long is stuck, us: brakes and locks take less.
STALL_US = 8_000_000
#: A word on the way is said where the last is this old, us: plan and speed tell the rest, a segment goes back after the
#: word, and who is thought to stand is given 20 s (``onboard/ways/standing.py``).
PLACE_US = 8_000_000
#: Orders to a drive are repeated; one whose last is older has none, us: five times the longest period of their repeat.
FRESH_US = 1_000_000

MOVES = (DriveMode.MOVING, DriveMode.BRAKING)

Place = TypeVar("Place")


@dataclass
class Stall:
    """Watches one drive; all times in us of one clock.

    ``repeats``: its orders are repeated, and who ceased to (a stop holds the machine) has not ordered anything.
    """

    repeats: bool = True
    _ordered_us: int = 0
    _since_us: int | None = None
    _position_mm: int | None = None
    _pause_us: int = 0

    def ordered(self, now_us: int) -> None:
        """The drive has an order to go on."""
        if self._since_us is None or not self._is_fresh(now_us):
            self._since_us = now_us
        self._ordered_us = now_us

    def _is_fresh(self, now_us: int) -> bool:
        return not self.repeats or now_us - self._ordered_us < FRESH_US

    def rests(self) -> None:
        """Nothing is asked of the drive."""
        self._since_us = None

    def sensed(self, position_mm: int, now_us: int, pause_us: int = 0) -> None:
        """Where the drive is, and how long what it does takes on the spot: a turn. Any motion shows that it works."""
        if self._since_us is not None and (position_mm, pause_us) != (self._position_mm, self._pause_us):
            self._since_us = now_us
        self._position_mm, self._pause_us = position_mm, pause_us

    @property
    def stuck_from_us(self) -> int:
        """From when on the drive has not moved for too long though it was told to."""
        return NEVER_US if self._since_us is None else self._since_us + STALL_US + self._pause_us

    def is_stuck(self, now_us: int) -> bool:
        """Whether it has not by now."""
        return now_us >= self.stuck_from_us and self._is_fresh(now_us)


@dataclass
class PlaceWords(Generic[Place]):
    """What one machine said last of its place, which tells what is news (docs/protocol.md, P10). Bus time in us."""

    #: Where it was by that, whether it moved, and when it said so; whoever says a place, on whatever occasion, sets it.
    last: tuple[Place | None, bool, int] = (None, False, 0)
    #: What its body was in then: whoever gives one of these back, and is still at that place, says where it is now.
    slots: set[Place] = field(default_factory=set)
    _mode: DriveMode | None = None

    def is_news(self, place: Place, mode: DriveMode, now_us: int) -> bool:
        """Whether the drive's state is to be told: it stops, or comes to the first other place since, or long after."""
        stops = mode not in MOVES and mode is not self._mode
        self._mode = mode
        told, was_moving, said_us = self.last
        return stops or (place != told and (not was_moving or now_us - said_us >= PLACE_US))

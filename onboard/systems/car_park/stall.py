"""What the words of a drive come to: whether it does what it is told, and when its place is told to the others.

One that does not makes its machine an obstacle until it moves (issue 4, point 3).
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Generic, TypeVar

from onboard.contract.codes import DriveMode
from onboard.core.behaviour import NEVER_US
from onboard.ways.kinematics import run_duration_us
from onboard.ways.lifts import stop_mm
from onboard.ways.site import TrackKind, WaySite

#: A drive that has orders and has not moved for so long is stuck, us: brakes and locks take less.
STALL_US = 8_000_000
#: A word on the way is said where the last is this old, us: plan and speed tell the rest, a segment goes back after the
#: word, and who is thought to stand is given 20 s (``onboard/ways/standing.py``).
PLACE_US = 8_000_000
#: Orders to a drive are repeated; one whose last is older has none, us: five times the longest period of their repeat.
FRESH_US = 1_000_000

MOVES = (DriveMode.MOVING, DriveMode.BRAKING)

Place = TypeVar("Place")


def carrier_silence_us(site: WaySite) -> int:
    """How long a carrier's drive on its way may say nothing, us: twice a run over half a segment.

    It says where it is at the middle and at the border of each (dbc/device.dbc).
    """
    pitch_mm = max(one.pitch_mm for one in site.tracks.values() if one.kind is not TrackKind.LIFT)
    return 2 * run_duration_us(pitch_mm // 2, site.carrier)


def lift_silence_us(site: WaySite, track: int) -> int:
    """The same of a lift's drive, which says where it is half way between two stops, and at each."""
    stops_mm = [stop_mm(site, track, index) for index in range(1, site.tracks[track].length + 1)]
    apart_mm = max((abs(one - other) for one, other in pairwise(stops_mm)), default=0)
    return 2 * run_duration_us(apart_mm // 2, site.lift)


@dataclass
class Stall:
    """Watches one drive; all times in us of one clock.

    ``repeats``: its orders are repeated, and who ceased to (a stop holds the machine) has not ordered anything.
    ``silence_us``: it may say nothing for so long where that is longer than ``STALL_US``.
    """

    repeats: bool = True
    silence_us: int = 0
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
        return NEVER_US if self._since_us is None else self._since_us + max(STALL_US, self.silence_us) + self._pause_us

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

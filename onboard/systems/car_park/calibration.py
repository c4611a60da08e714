"""What interval nine of ten customers' waits are in, learned from how the last ones went.

Adaptive conformal inference: the interval is that of the quantiles of what was seen lately, at a level that moves with
each miss and each hit (Gibbs and Candes 2021, "Adaptive conformal inference under distribution shift", (2)), so that in
the long run as many are in it as asked for, whatever the law, and although the bus rounds intervals up.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

_ALL_PPM = 1_000_000
#: One in ten may be outside, of a million.
MISSES_PPM = 100_000
#: How far a miss moves the level, of what is then asked for: by 4.5 %, which nine hits take back (docs/decisions.md).
STEP_PPM = 50_000
#: So many are enough for the quantiles at that level; with all of these the level may have come to leave out none.
FEWEST_KNOWN = 2 * _ALL_PPM // MISSES_PPM - 1
#: So many of the last are looked at: a day or two of a compartment's, so that it follows a change within days.
MOST_SEEN = 100


class WaitInterval(NamedTuple):
    """From when to when, us."""

    low_us: int
    high_us: int


@dataclass
class Calibration:
    """Intervals of one class of waits. ``level_ppm``: what share is to be left out, of a million, both sides."""

    level_ppm: int = MISSES_PPM
    _seen_us: deque[int] = field(default_factory=lambda: deque(maxlen=MOST_SEEN))

    def interval(self, before: WaitInterval) -> WaitInterval:
        """The interval now; ``before``: what may be said while too few were seen for the level."""
        ordered = sorted(self._seen_us)
        outside = self.level_ppm * (len(ordered) + 1) // (2 * _ALL_PPM)
        if outside < 1 and len(ordered) >= FEWEST_KNOWN:
            return WaitInterval(ordered[0], ordered[-1])
        if outside < 1:
            return WaitInterval(min(before.low_us, ordered[0]), max(before.high_us, ordered[-1])) if ordered else before
        outside = min(outside, (len(ordered) + 1) // 2)
        return WaitInterval(ordered[outside - 1], ordered[-outside])

    def middle_us(self) -> int | None:
        """The median of what was seen; None of nothing."""
        return sorted(self._seen_us)[len(self._seen_us) // 2] if self._seen_us else None

    def learn(self, seen_us: int, *, is_kept: bool) -> None:
        """One more was seen, and whether it was in the interval that had been said of it."""
        self._seen_us.append(seen_us)
        missed_ppm = 0 if is_kept else _ALL_PPM
        level_ppm = self.level_ppm + STEP_PPM * (MISSES_PPM - missed_ppm) // _ALL_PPM
        self.level_ppm = min(max(level_ppm, 0), _ALL_PPM - 1)

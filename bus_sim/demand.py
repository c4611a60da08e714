"""Who comes to a site: the law that intervals are drawn by, and the mistake that every demand may hold."""

import random
from typing import NamedTuple


class DemandError(ValueError):
    """A person's mistake in a demand, as one clear line: file, line, value and remedy."""


class Law(NamedTuple):
    """Intervals by a normal law of these parameters (s), cut off at 0 by drawing again."""

    mean_s: float
    sigma_s: float

    def draw_us(self, chance: random.Random) -> int:
        """One interval above 0, us."""
        while True:
            interval_us = round(chance.gauss(self.mean_s, self.sigma_s) * 1e6)
            if interval_us > 0:
                return interval_us

    def check(self, what: str) -> None:
        """Raise ``DemandError`` unless the mean is above 0 and the deviation 0 or more."""
        if not self.mean_s > 0:
            raise DemandError(f"{what}: mean {self.mean_s} s: must be above 0")
        if not self.sigma_s >= 0:
            raise DemandError(f"{what}: standard deviation {self.sigma_s} s: must be 0 or more")

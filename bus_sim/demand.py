"""Who comes to a site: the law that intervals are drawn by, and the mistake that every demand may hold."""

import random
from typing import NamedTuple

from onboard.config.arguments import whole

#: Longest run, and longest mean time between two who come, s: eleven days.
LONGEST_S = 1_000_000
#: Most cars of a run: a month of the largest car park here.
MOST_CARS = 100_000
#: Most orders of a run: their numbers have 16 bits on the wire, of which some systems use a part.
MOST_ORDERS = 10_000
#: Most seeds of one command.
MOST_SEEDS = 1_000_000


class DemandError(ValueError):
    """A person's mistake in a demand, as one clear line: file, line, value and remedy."""


def check_count(option: str, count: int, most: int) -> None:
    """Raise ``DemandError`` for a number of those who come that is below 0, or above ``most``."""
    if not 0 <= count <= most:
        raise DemandError(f"{option} {count}: must be from 0 to {most}")


def read_seeds(text: str) -> range:
    """``A`` or ``A-B``. Raises ``DemandError`` for anything else."""
    first, dash, last = text.partition("-")
    low, high = whole(first), whole(last if dash else first)
    if low is None or high is None or high < low:
        raise DemandError(f"--seeds {text}: must be a seed, or the first and the last of several, such as 1-16")
    if high - low >= MOST_SEEDS:
        raise DemandError(f"--seeds {text}: more than {MOST_SEEDS}; play them in parts")
    return range(low, high + 1)


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
        """Raise ``DemandError`` unless the mean is above 0, the deviation 0 or more, and both at most ``LONGEST_S``."""
        if not 0 < self.mean_s <= LONGEST_S:
            raise DemandError(f"{what}: mean {self.mean_s:g} s: must be above 0, and at most {LONGEST_S}")
        if not 0 <= self.sigma_s <= LONGEST_S:
            raise DemandError(f"{what}: standard deviation {self.sigma_s:g} s: must be from 0 to {LONGEST_S}")

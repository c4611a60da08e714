"""Times of one kind described: how many, mean, standard deviation, percentiles. Without numpy: boards lack it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum, sqrt


@dataclass(frozen=True, slots=True)
class Durations:
    """Times in s: how many, mean, standard deviation (of these, no estimate), percentiles, longest."""

    count: int
    mean_s: float
    sigma_s: float
    p50_s: float
    p95_s: float
    p99_s: float
    max_s: float

    @classmethod
    def of(cls, times_us: Sequence[int]) -> "Durations":
        """From single times in us; zeros where there are none."""
        if not times_us:
            return cls(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        seconds = sorted(time_us / 1e6 for time_us in times_us)
        mean_s = fsum(seconds) / len(seconds)
        sigma_s = sqrt(fsum((value - mean_s) ** 2 for value in seconds) / len(seconds))
        p50_s, p95_s, p99_s = (percentile(seconds, share) for share in (0.50, 0.95, 0.99))
        return cls(len(seconds), mean_s, sigma_s, p50_s, p95_s, p99_s, seconds[-1])

    def __str__(self) -> str:
        if not self.count:
            return "nobody"
        return (
            f"mean {self.mean_s:.1f} s   sigma {self.sigma_s:.1f}   50 % {self.p50_s:.1f}   "
            f"95 % {self.p95_s:.1f}   99 % {self.p99_s:.1f}   max {self.max_s:.1f}   ({self.count})"
        )


def percentile(ordered: Sequence[float], share: float) -> float:
    """The value below which ``share`` (0 to 1) of an ascending, non-empty sequence lies, interpolated linearly.

    Hyndman and Fan 1996, definition 7: what numpy and most spreadsheets give.
    """
    place = share * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (ordered[above] - ordered[below]) * (place - below)

"""Rest-to-rest motion on one axis: trapezoidal, or triangular where the run is too short for top speed.

With ``d`` the distance, ``v`` the top speed and ``a`` acceleration and braking, a run lasts ``d/v + v/a`` where
``d >= v*v/a`` and ``2*sqrt(d/a)`` otherwise (Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and
Robots, 2008, chapter 3). Integer arithmetic throughout (``math.isqrt``), so every machine computes the same
microsecond; each result is a bound, rounded to the side that its docstring names.
"""

from functools import lru_cache
from math import isqrt
from typing import NamedTuple

from onboard.ways.site import Axis

_NS_PER_S = 1_000_000_000
_NS_PER_US = 1_000
_US_PER_MS = 1_000


class RestToRest(NamedTuple):
    """A motion from rest to rest over ``distance_mm`` >= 0."""

    distance_mm: int
    axis: Axis


class _Bounds(NamedTuple):
    """A time in ns that is at least ``low`` and at most ``high``; equal where it is a whole number of ns."""

    low: int
    high: int

    def minus(self, other: "_Bounds") -> "_Bounds":
        return _Bounds(self.low - other.high, self.high - other.low)


def ceil_ms(time_us: int) -> int:
    """The next whole millisecond, in us: leg boundaries are on the wire in milliseconds."""
    return -(-time_us // _US_PER_MS) * _US_PER_MS


@lru_cache(maxsize=4096)
def run_duration_us(distance_mm: int, axis: Axis) -> int:
    """Duration of a run over ``distance_mm`` >= 0, rounded up to a whole millisecond: never shorter than the motion."""
    return ceil_ms(_ceil_us(_duration_ns(distance_mm, axis).high))


def time_at_us(run: RestToRest, travelled_mm: int) -> int:
    """Time from the start until ``travelled_mm`` (clamped to the run) is reached, rounded down: never too late.

    For what the front of a body enters. Less than 1 us and 2 ns below the exact time.
    """
    return _time_at_ns(run, travelled_mm).low // _NS_PER_US


def cleared_at_us(run: RestToRest, travelled_mm: int) -> int:
    """As ``time_at_us`` but rounded up, never too early: for what the rear of a body leaves.

    The end of the run is its ``run_duration_us``, as the leg on the wire ends no sooner.
    """
    if travelled_mm >= run.distance_mm:
        return run_duration_us(run.distance_mm, run.axis)
    return _ceil_us(_time_at_ns(run, travelled_mm).high)


def _time_at_ns(run: RestToRest, travelled_mm: int) -> _Bounds:
    """The three parts of the profile: speeding up, top speed, braking (the mirror image of speeding up)."""
    distance_mm, (speed, acceleration) = run.distance_mm, (run.axis.speed_mm_s, run.axis.acceleration_mm_s2)
    if travelled_mm <= 0:
        return _Bounds(0, 0)
    if travelled_mm >= distance_mm:
        return _duration_ns(distance_mm, run.axis)
    remaining_mm = distance_mm - travelled_mm
    half_way_or_at_speed = min(distance_mm * acceleration, speed * speed)
    if 2 * travelled_mm * acceleration <= half_way_or_at_speed:
        return _from_rest_ns(travelled_mm, acceleration)
    if 2 * remaining_mm * acceleration <= half_way_or_at_speed:
        return _duration_ns(distance_mm, run.axis).minus(_from_rest_ns(remaining_mm, acceleration))
    return _ratio_ns(2 * acceleration * travelled_mm + speed * speed, 2 * acceleration * speed)


def _duration_ns(distance_mm: int, axis: Axis) -> _Bounds:
    speed, acceleration = axis.speed_mm_s, axis.acceleration_mm_s2
    if distance_mm * acceleration >= speed * speed:
        return _ratio_ns(distance_mm * acceleration + speed * speed, speed * acceleration)
    return _root_ns(4 * distance_mm, acceleration)


def _from_rest_ns(distance_mm: int, acceleration_mm_s2: int) -> _Bounds:
    return _root_ns(2 * distance_mm, acceleration_mm_s2)


def _ratio_ns(numerator: int, denominator: int) -> _Bounds:
    """Bounds of ``numerator / denominator`` seconds."""
    low, rest = divmod(numerator * _NS_PER_S, denominator)
    return _Bounds(low, low + (rest > 0))


def _root_ns(numerator: int, denominator: int) -> _Bounds:
    """Bounds of ``sqrt(numerator / denominator)`` seconds."""
    square, rest = divmod(numerator * _NS_PER_S * _NS_PER_S, denominator)
    low = isqrt(square)
    return _Bounds(low, low + (rest > 0 or low * low < square))


def _ceil_us(time_ns: int) -> int:
    return -(-time_ns // _NS_PER_US)

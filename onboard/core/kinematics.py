"""Rest-to-rest motion on one axis: trapezoidal, or triangular where the run is too short for top speed.

Integer arithmetic throughout (``math.isqrt``), so every machine computes the same microsecond.
"""

from functools import lru_cache
from math import isqrt

from onboard.core.site import Axis

_US2_PER_S2 = 1_000_000_000_000
_MS_US = 1000


def ceil_ms(time_us: int) -> int:
    """The next whole millisecond, in us: leg boundaries are on the wire in milliseconds."""
    return -(-time_us // _MS_US) * _MS_US


def _acceleration_us(distance_mm: int, axis: Axis) -> int:
    """Time to travel ``distance_mm`` from rest under constant acceleration: sqrt(2 s / a)."""
    return isqrt(2 * distance_mm * _US2_PER_S2 // axis.acceleration_mm_s2)


@lru_cache(maxsize=4096)
def run_duration_us(distance_mm: int, axis: Axis) -> int:
    """Duration of a run over ``distance_mm`` >= 0, rounded up to a whole millisecond."""
    if distance_mm == 0:
        return 0
    speed, acceleration = axis.speed_mm_s, axis.acceleration_mm_s2
    if distance_mm * acceleration >= speed * speed:
        exact_us = distance_mm * 1_000_000 // speed + speed * 1_000_000 // acceleration
    else:
        exact_us = 2 * isqrt(distance_mm * _US2_PER_S2 // acceleration)
    # Two roundings down above lose less than 4 us.
    return ceil_ms(exact_us + 4)


@lru_cache(maxsize=65536)
def time_at_us(travelled_mm: int, distance_mm: int, axis: Axis) -> int:
    """Time since the start of a run over ``distance_mm`` at which ``travelled_mm`` (clamped to the run) is reached.

    Exact to some us; the end of the run is its duration rounded up, never earlier than the motion ends.
    """
    if travelled_mm <= 0:
        return 0
    if travelled_mm >= distance_mm:
        return run_duration_us(distance_mm, axis)
    speed, acceleration = axis.speed_mm_s, axis.acceleration_mm_s2
    ramp_mm = min(speed * speed // (2 * acceleration), distance_mm // 2)
    if travelled_mm <= ramp_mm:
        return _acceleration_us(travelled_mm, axis)
    remaining_mm = distance_mm - travelled_mm
    if remaining_mm <= ramp_mm:
        return run_duration_us(distance_mm, axis) - _acceleration_us(remaining_mm, axis)
    return _acceleration_us(ramp_mm, axis) + (travelled_mm - ramp_mm) * 1_000_000 // speed

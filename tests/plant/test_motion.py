"""Closed-form motion against numeric integration and against what physics says."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus_sim.systems.car_park.plant.motion import Motion, braking, driving, standing, stop_distance_mm

positions = st.floats(-20_000, 20_000)
speeds = st.floats(-1_500, 1_500)
rates = st.floats(100, 2_000)
limits = st.floats(50, 1_500)


def integrate(x: float, v: float, target: float, limit: float, rate: float) -> tuple[float, float]:
    """Time (s) and final position of the same move, found by stepping a bang-bang controller; knows no phases."""
    dt = 1e-3
    t = 0.0
    while abs(target - x) > 1.0 or abs(v) > 2.0:
        way = target - x
        # The speed from which one can still stop in time; brake where faster, else accelerate.
        wanted = math.copysign(min(limit, math.sqrt(2 * rate * abs(way))), way)
        v += max(-rate * dt, min(rate * dt, wanted - v))
        x += v * dt
        t += dt
        assert t < 1000
    return t, x


@pytest.mark.parametrize(
    ("x", "v", "target", "limit", "rate"),
    [
        (0, 0, 10_000, 1500, 500),
        (0, 0, 1_000, 1500, 500),
        (5_000, 800, 5_100, 1500, 500),
        (5_000, -800, 9_000, 1500, 500),
        (0, 1500, 9_000, 600, 500),
        (9_000, -300, -4_000, 750, 900),
    ],
)
def test_duration_agrees_with_numeric_integration(x: float, v: float, target: float, limit: float, rate: float) -> None:
    motion = driving(x, v, target, limit, rate, 0)
    duration_s, _ = integrate(x, v, target, limit, rate)
    assert motion.end_us / 1e6 == pytest.approx(duration_s, abs=0.15)
    assert motion.at(motion.end_us) == (target, 0.0)


def test_rest_to_rest_times_are_those_of_the_textbook() -> None:
    # Trapezoid: s/v + v/a = 24000/1500 + 1500/500 = 19 s. Triangle: 2 sqrt(s/a) = 2 sqrt(2000/500) = 4 s.
    assert driving(0, 0, 24_000, 1500, 500, 0).end_us == 19_000_000
    assert driving(7, 0, -1_993, 1500, 500, 0).end_us == 4_000_000


@given(positions, speeds, positions, limits, rates)
def test_any_motion_is_smooth_within_limits_and_ends_at_rest_on_target(
    x: float, v: float, target: float, limit: float, rate: float
) -> None:
    motion = driving(x, v, target, limit, rate, 1_000)
    begin, end = motion.start_us, motion.end_us
    assert motion.at(begin)[0] == pytest.approx(x, abs=1e-6) or begin == end
    assert motion.at(end) == (target, 0.0)
    before: tuple[float, float] | None = None
    steps = 200
    for step in range(steps + 1):
        now_us = begin + (end - begin) * step // steps
        position, speed = motion.at(now_us)
        assert abs(speed) <= max(limit, abs(v)) + 1e-3
        if before is not None:
            dt = (end - begin) / steps / 1e6
            assert abs(speed - before[1]) <= rate * (dt + 2e-6) + 1e-2
            assert abs(position - before[0]) <= max(limit, abs(v)) * (dt + 2e-6) + 1e-2
        before = position, speed


@given(positions, speeds, rates)
def test_braking_ends_at_the_stop_distance(x: float, v: float, rate: float) -> None:
    motion = braking(x, v, rate, 0)
    assert motion.final_mm == pytest.approx(x + stop_distance_mm(v, rate), abs=1e-6)
    assert motion.end_us == pytest.approx(abs(v) / rate * 1e6, abs=1.1)


@given(positions, speeds, positions, limits, rates, st.floats(0, 1))
def test_a_position_is_reached_when_the_motion_says(
    x: float, v: float, target: float, limit: float, rate: float, share: float
) -> None:
    motion = driving(x, v, target, limit, rate, 0)
    low, high = motion.extremes_mm(0, motion.end_us)
    place = low + share * (high - low)
    when_us = motion.next_reach_us(place, -1)
    if when_us is None:  # touched at an extreme only
        assert min(place - low, high - place) < 1
        return
    here = motion.at(when_us)[0]
    # A microsecond's way at most beyond it, and not there before.
    assert abs(here - place) <= 2e-6 * max(limit, abs(v)) + 1e-4
    first = motion.at(0)[0] - place
    for step in range(1, 50):
        there = motion.at((when_us - 1) * step // 50)[0] - place
        assert there * first >= -1e-4 * abs(first) - 1e-4


def test_a_motion_may_be_changed_at_any_moment_without_a_jump() -> None:
    motion = driving(0, 0, 20_000, 1500, 500, 0)
    for now_us in range(300_000, 9_000_000, 777_777):
        position, speed = motion.at(now_us)
        changed: Motion = driving(position, speed, 3_000, 1500, 500, now_us)
        assert changed.at(now_us) == pytest.approx((position, speed))
        assert changed.at(changed.end_us) == (3_000, 0.0)


def test_standing_never_reaches_anything_else() -> None:
    assert standing(5, 0).next_reach_us(6, 0) is None
    assert standing(5, 7).at(10**12) == (5, 0.0)

from decimal import Decimal, localcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.ways.kinematics import RestToRest, ceil_ms, cleared_at_us, run_duration_us, time_at_us
from onboard.ways.site import Axis

CARRIER = Axis(1_500, 500)  # reaches top speed after 3 s and 2,250 mm

AXES = st.builds(Axis, st.integers(10, 20_000), st.integers(10, 20_000))
DISTANCES_MM = st.integers(1, 400_000)


def position_mm(distance_mm: int, axis: Axis, time_us: Decimal) -> Decimal:
    """Where the carrier is, by the textbook's equations of motion and 50 digits."""
    with localcontext() as context:
        context.prec = 50
        d, v, a, t = (Decimal(x) for x in (distance_mm, axis.speed_mm_s, axis.acceleration_mm_s2, time_us))
        t /= 1_000_000
        top = min(v, (d * a).sqrt())
        end = d / top + top / a
        if t <= 0 or t >= end:
            return Decimal(0) if t <= 0 else d
        if t <= top / a:
            return a * t * t / 2
        if t >= end - top / a:
            return d - a * (end - t) ** 2 / 2
        return top * t - top * top / a / 2


@pytest.mark.parametrize(
    ("distance_mm", "duration_us"),
    [
        (0, 0),
        (2_000, 4_000_000),  # triangular: 2 sqrt(2 m / 0.5 m/s2)
        (4_500, 6_000_000),  # top speed is just reached
        (12_000, 11_000_000),  # 12 m / 1.5 m/s + 3 s
        (2_400, 4_382_000),  # 4.38178 s, up to the next millisecond
    ],
)
def test_duration_of_a_run(distance_mm: int, duration_us: int) -> None:
    assert run_duration_us(distance_mm, CARRIER) == duration_us


@pytest.mark.parametrize(
    ("travelled_mm", "time_us"),
    [(-5, 0), (0, 0), (1_000, 2_000_000), (2_250, 3_000_000), (6_000, 5_500_000), (11_000, 9_000_000)],
)
def test_where_the_time_is_whole_both_roundings_agree(travelled_mm: int, time_us: int) -> None:
    run = RestToRest(12_000, CARRIER)
    assert time_at_us(run, travelled_mm) == cleared_at_us(run, travelled_mm) == time_us


def test_the_end_of_a_run_is_cleared_with_its_leg_and_reached_no_later() -> None:
    run = RestToRest(2_400, CARRIER)
    assert cleared_at_us(run, 2_400) == cleared_at_us(run, 9_999) == 4_382_000
    assert time_at_us(run, 2_400) == 4_381_780


@given(DISTANCES_MM, AXES)
def test_a_leg_is_never_shorter_than_the_motion_and_less_than_a_millisecond_longer(distance: int, axis: Axis) -> None:
    duration_us = run_duration_us(distance, axis)
    assert duration_us % 1_000 == 0
    assert position_mm(distance, axis, Decimal(duration_us)) == distance
    assert position_mm(distance, axis, Decimal(duration_us - 1_000) - Decimal("0.01")) < distance


@given(DISTANCES_MM, AXES, st.floats(0, 1, exclude_min=True, exclude_max=True))
def test_a_front_is_never_expected_late_nor_a_rear_early_and_both_within_a_microsecond(
    distance: int, axis: Axis, part: float
) -> None:
    travelled = int(distance * part)
    run = RestToRest(distance, axis)
    front_us, rear_us = time_at_us(run, travelled), cleared_at_us(run, travelled)
    tick = Decimal("1.003")  # a microsecond and the nanoseconds that the docstring admits
    tiny = Decimal("1e-30")
    assert position_mm(distance, axis, Decimal(front_us)) <= travelled + tiny
    assert position_mm(distance, axis, front_us + tick) >= travelled - tiny
    assert position_mm(distance, axis, Decimal(rear_us)) >= travelled - tiny
    assert position_mm(distance, axis, rear_us - tick) <= travelled + tiny


def test_next_whole_millisecond() -> None:
    assert [ceil_ms(us) for us in (0, 1, 999, 1_000, 1_001)] == [0, 1_000, 1_000, 1_000, 2_000]

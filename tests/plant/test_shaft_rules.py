"""The oracle finds every hazard of a shaft that devices without their interlocks would make; the world lets them."""

import pytest

from bus_sim.systems.car_park.plant.motion import driving, standing
from tests.plant.support import LEFT, RIGHT, ROBOT, SECOND, Bench, three_floors

FLOOR_MM = 2500
OTHER = 12


def move(bench: Bench, target_mm: float, node: int = ROBOT) -> None:
    now_us = bench.timers.now_us()
    position_mm, speed_mm_s = bench.world.robots[node].motion.at(now_us)
    bench.world.move_carrier(node, driving(position_mm, speed_mm_s, target_mm, 1500, 500, now_us))


def lift(bench: Bench, floor: int, node: int = LEFT) -> None:
    """The platform's motion, without its device: nobody tells the world that it has arrived."""
    now_us = bench.timers.now_us()
    position_mm, speed_mm_s = bench.world.platforms[node].motion.at(now_us)
    bench.world.move_platform(node, driving(position_mm, speed_mm_s, (floor - 1) * FLOOR_MM, 1083, 500, now_us))


def arrive(bench: Bench, node: int = LEFT) -> None:
    motion = bench.world.platforms[node].motion
    bench.timers.run_until(motion.end_us)
    bench.world.move_platform(node, standing(motion.final_mm, motion.end_us))


def bench_at(floor: int, index: int) -> Bench:
    """MR1 at p(floor,index), where the site file may not put it."""
    bench = Bench(three_floors())
    bench.world.robots[ROBOT].track = floor
    bench.world.move_carrier(ROBOT, standing((index - 1) * 2400.0, 0))
    return bench


def test_a_platform_leaves_while_a_carrier_stands_over_its_sill() -> None:
    bench = bench_at(1, 1)
    move(bench, -1200)
    bench.timers.run_for(10 * SECOND)
    lift(bench, 2)
    assert bench.rules == ["LIFT_CRUSH"]
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["LIFT_CRUSH", "FALL"], "and then hangs in an empty shaft"


@pytest.mark.parametrize("after_us", [500_000, 1_500_000, 3_000_000])
def test_a_platform_leaves_in_the_middle_of_a_crossing(after_us: int) -> None:
    # Nothing is told between the carrier's start and its arrival.
    bench = bench_at(1, 1)
    move(bench, -2400)
    bench.timers.run_for(after_us)
    lift(bench, 2)
    assert bench.rules == ["LIFT_CRUSH"]


def test_a_platform_may_leave_with_what_stands_wholly_on_it_or_only_touches_its_sill() -> None:
    bench = bench_at(1, 1)
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    lift(bench, 3)
    arrive(bench)
    move(bench, 0)
    bench.timers.run_for(10 * SECOND)
    move(bench, -50)
    bench.timers.run_for(10 * SECOND)
    lift(bench, 1)
    arrive(bench)
    bench.timers.run_for(SECOND)
    assert bench.rules == []
    assert bench.world.robots[ROBOT].track == 3


@pytest.mark.parametrize(("target_mm", "rules"), [(-50.0, []), (-51.0, ["FALL"]), (5 * 2400 + 51.0, ["FALL"])])
def test_a_carrier_over_an_empty_shaft(target_mm: float, rules: list[str]) -> None:
    bench = bench_at(2, 2)
    move(bench, target_mm)
    bench.timers.run_for(20 * SECOND)
    assert bench.rules == rules


def test_a_carrier_that_dashes_into_an_empty_shaft_and_back_between_two_looks_is_found_with_the_time() -> None:
    bench = bench_at(2, 1)
    now_us = bench.timers.now_us()
    # Its front passes the sill 50 mm on: sqrt(2 * 50 / 500) s after the start.
    bench.world.move_carrier(ROBOT, driving(0.0, 0.0, -300.0, 1500, 500, now_us))
    bench.timers.run_for(800_000)
    position_mm, speed_mm_s = bench.world.robots[ROBOT].motion.at(bench.timers.now_us())
    bench.world.move_carrier(ROBOT, driving(position_mm, speed_mm_s, 0.0, 1500, 500, bench.timers.now_us()))
    bench.timers.run_for(20 * SECOND)
    violations = bench.oracle.finish()
    assert [violation.rule.name for violation in violations] == ["FALL"]
    assert violations[0].time_us == pytest.approx(447_214, abs=20)


def test_a_fall_that_lasts_is_told_once_and_again_when_it_comes_back() -> None:
    bench = bench_at(2, 1)
    for target_mm in (-1000.0, -1100.0, 0.0, 2400.0, -1000.0):
        move(bench, target_mm)
        bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["FALL", "FALL"]


def test_a_platform_that_nobody_told_to_have_arrived_is_there_from_the_end_of_its_motion() -> None:
    bench = bench_at(2, 1)
    lift(bench, 2)
    bench.timers.run_until(bench.world.platforms[LEFT].motion.end_us + 1000)
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == []


def test_a_platform_of_the_other_lift_is_no_floor_here() -> None:
    bench = bench_at(2, 1)
    lift(bench, 2, RIGHT)
    arrive(bench, RIGHT)
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["FALL"]


@pytest.mark.parametrize("shut_out", [False, True])
def test_a_carrier_that_moves_on_a_moving_platform(shut_out: bool) -> None:
    bench = bench_at(1, 1)
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    if shut_out:
        move(bench, -2360)  # on the platform still, and moving as it leaves
        bench.timers.run_for(100_000)
    lift(bench, 2)
    bench.timers.run_for(SECOND)
    if not shut_out:
        move(bench, -2390)
    arrive(bench)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["RIDE_AT_REST"]
    assert bench.world.robots[ROBOT].track == 2


def two_on_one_alley() -> Bench:
    bench = bench_at(1, 1)
    bench.world.robots[OTHER].track = 1
    bench.world.move_carrier(OTHER, standing(2400.0, 0))
    assert bench.rules == []
    return bench


def test_two_bodies_on_one_platform() -> None:
    bench = two_on_one_alley()
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    move(bench, -60, OTHER)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["ONE_ABOARD"], "60 mm of room between them, but one stands partly on the platform"
    move(bench, -2400, OTHER)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["ONE_ABOARD", "BODIES_APART"]


def test_following_onto_a_platform_that_has_been_left_is_no_fault() -> None:
    bench = two_on_one_alley()
    lift(bench, 2)
    arrive(bench)
    lift(bench, 1)
    arrive(bench)
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    lift(bench, 2)
    arrive(bench)
    move(bench, 0)
    bench.timers.run_for(10 * SECOND)
    lift(bench, 1)
    arrive(bench)
    move(bench, -2400, OTHER)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == []


def test_bodies_are_judged_apart_on_the_platform_too() -> None:
    bench = two_on_one_alley()
    move(bench, -2400)
    bench.timers.run_for(10 * SECOND)
    move(bench, -101, OTHER)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules.count("BODIES_APART") == 1


def test_beyond_the_far_side_of_a_platform_is_off_the_track() -> None:
    bench = bench_at(1, 1)
    move(bench, -3700)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["ON_TRACK"]


def test_where_no_lift_serves_the_end_the_track_ends() -> None:
    bench = Bench()
    move(bench, -1250)
    bench.timers.run_for(60 * SECOND)
    assert bench.rules == ["ON_TRACK"]

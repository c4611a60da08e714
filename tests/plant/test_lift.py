"""Lifts in the plant: the platform's drive and sensors, the shaft gates, and robots that ride."""

import pytest

from bus_sim.systems.car_park.plant.bodies import Aboard
from onboard.contract.codes import DriveMode, ShuttleAction, ShuttleMode, Side
from onboard.contract.messages import DriveOrder, DriveState, PlatformState, ShuttleOrder
from onboard.core.site import Segment
from onboard.ways.kinematics import run_duration_us
from tests.plant.support import CAR, LEFT, RIGHT, ROBOT, SECOND, Bench, three_floors

FLOOR_MM = 2500
#: Platform positions on an alley of six positions.
AT_LEFT_MM, AT_RIGHT_MM = -2400, 6 * 2400


def ride(bench: Bench, lift: int, floor: int, sequence: int) -> None:
    bench.drive((floor - 1) * FLOOR_MM, sequence, lift, for_us=15 * SECOND)


def board(bench: Bench, sequence: int = 1, target_mm: int = AT_LEFT_MM) -> None:
    bench.drive(target_mm, sequence, for_us=20 * SECOND)
    assert bench.position_mm() == target_mm


def sensed(bench: Bench, lift: int = LEFT) -> list[tuple[bool, bool, int]]:
    """What a platform said, without the slow repeats of the same."""
    states = [(s.carrier_aboard, s.crossing, s.load_kg) for _, s in bench.links[lift].all(PlatformState)]
    return [state for n, state in enumerate(states) if n == 0 or state != states[n - 1]]


def arrival_us(bench: Bench, node: int, since_us: int) -> int:
    said = bench.links[node].all(DriveState)
    return next(t for t, s in said if t > since_us and s.mode is DriveMode.STANDING) - since_us


# --- the drive of the platform --------------------------------------------------------------------------------------


# By hand, 1083 mm/s and 500 mm/s^2: distance / 1.083 m/s + 2.166 s, rounded up to a whole microsecond.
@pytest.mark.parametrize(("floor", "exact_us"), [(2, 4_474_403), (3, 6_782_806)])
def test_a_ride_takes_its_time_from_rest_to_rest_and_no_longer_than_planned(floor: int, exact_us: int) -> None:
    bench = Bench(three_floors())
    ride(bench, LEFT, floor, 1)
    took_us = arrival_us(bench, LEFT, 0)
    assert took_us == exact_us
    planned_us = run_duration_us((floor - 1) * FLOOR_MM, bench.site.lift)
    assert planned_us - 1000 < took_us <= planned_us
    last = bench.links[LEFT].last(DriveState)
    assert (last.position_mm, last.speed_mm_s, last.at_mark, last.mode) == (
        (floor - 1) * FLOOR_MM,
        0,
        True,
        DriveMode.STANDING,
    )
    assert bench.rules == []


def test_the_mark_of_a_floor_is_seen_in_passing() -> None:
    bench = Bench(three_floors())
    ride(bench, LEFT, 3, 1)
    moving = [s for _, s in bench.links[LEFT].all(DriveState) if s.mode is DriveMode.MOVING]
    assert [s.at_mark for s in moving if s.position_mm == FLOOR_MM] == [True]
    assert not any(s.at_mark for s in moving if s.position_mm in (FLOOR_MM // 2, 3 * FLOOR_MM // 2))


def test_a_platform_brakes_between_floors_when_orders_stop_and_goes_on_with_the_next() -> None:
    bench = Bench(three_floors())
    board(bench)
    since_us = bench.timers.now_us()
    bench.drive(2 * FLOOR_MM, 1, LEFT, for_us=2 * SECOND)
    bench.timers.run_until(since_us + 20 * SECOND)
    assert bench.links[LEFT].last(DriveState).mode is DriveMode.STANDING
    assert 0 < bench.links[LEFT].last(DriveState).position_mm < 2 * FLOOR_MM
    assert bench.world.platform_floor(LEFT) is None and bench.world.is_riding(ROBOT)
    ride(bench, LEFT, 3, 2)
    assert bench.world.standing_position(ROBOT) == Segment(3, 0)
    assert bench.rules == []


@pytest.mark.parametrize("target_mm", [-1, 2 * FLOOR_MM + 1])
def test_a_target_beyond_the_shaft_is_refused_visibly(target_mm: int) -> None:
    bench = Bench(three_floors())
    bench.drive(target_mm, 1, LEFT, for_us=SECOND)
    assert bench.links[LEFT].last(DriveState).mode is DriveMode.FAULT
    assert bench.world.platform_floor(LEFT) == 1


def test_the_platform_does_not_leave_what_is_over_its_sill_and_does_once_it_is_free() -> None:
    bench = Bench(three_floors())
    bench.drive(-1200, 1)
    bench.drive(FLOOR_MM, 1, LEFT, for_us=2 * SECOND)
    assert bench.lifts[LEFT].fault == "something is over the sill"
    assert bench.links[LEFT].last(DriveState).mode is DriveMode.FAULT
    assert bench.world.platform_floor(LEFT) == 1
    bench.drive(0, 2)
    assert bench.links[LEFT].last(DriveState).mode is DriveMode.STANDING
    ride(bench, LEFT, 2, 2)
    assert bench.world.platform_floor(LEFT) == 2
    assert bench.rules == []


def test_the_curtain_holds_the_platform_while_a_carrier_is_just_crossing() -> None:
    bench = Bench(three_floors())
    bench.drive(AT_LEFT_MM, 1, for_us=4 * SECOND)
    assert -2400 + 50 < bench.position_mm() < -50 and bench.world.robots[ROBOT].motion.at(bench.timers.now_us())[1]
    bench.links[LEFT].order(DriveOrder(LEFT, 1, FLOOR_MM, 1083))
    assert bench.lifts[LEFT].fault == "something is over the sill"
    bench.drive(AT_LEFT_MM, 1)
    assert bench.world.aboard(LEFT) == ROBOT
    assert bench.rules == []


# --- what the platform senses ---------------------------------------------------------------------------------------


def test_the_platform_tells_the_carrier_over_the_sill_and_aboard_and_away_again() -> None:
    bench = Bench(three_floors())
    board(bench)
    bench.drive(2400, 2)
    none, over, aboard = (False, False, 0), (False, True, 0), (True, False, 0)
    assert sensed(bench) == [none, over, none, aboard, none, over, none]
    assert sensed(bench, RIGHT) == [none]
    said = bench.links[LEFT].all(PlatformState)
    begin_us = next(t for t, s in said if s.crossing)
    end_us = next(t for t, s in said if s.carrier_aboard)
    # From 2400 mm at 500 mm/s^2 over 4800 mm: the front reaches the sill 2450 mm on, the middle is at 2400 mm, 3.098 s.
    assert 3_098_000 < begin_us < 3_200_000
    assert end_us == arrival_us(bench, ROBOT, 0)


def test_a_carrier_that_touches_the_sill_is_not_over_it_and_one_that_stops_over_it_is() -> None:
    bench = Bench(three_floors())
    bench.drive(-50, 1)
    assert sensed(bench) == [(False, False, 0)]
    bench.drive(-51, 2)
    assert sensed(bench)[-1] == (False, True, 0)


def test_the_load_is_that_of_the_car_aboard() -> None:
    bench = Bench(three_floors())
    bench.world.cars["blue"], bench.world.where["blue"] = CAR, Aboard(ROBOT)
    bench.oracle.take_stock()
    board(bench)
    ride(bench, LEFT, 2, 1)
    assert sensed(bench)[-1] == (True, False, CAR.mass_kg)
    assert bench.rules == []


def test_an_idle_platform_says_little() -> None:
    bench = Bench(three_floors())
    bench.timers.run_until(100 * SECOND)
    assert [t for t, _ in bench.links[RIGHT].all(PlatformState)] == [n * 10 * SECOND for n in range(11)]


# --- riding ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("lift", "target_mm", "index"), [(LEFT, AT_LEFT_MM, 0), (RIGHT, AT_RIGHT_MM, 7)])
def test_a_carrier_rides_and_leaves_on_the_other_floor_and_its_car_with_it(
    lift: int, target_mm: int, index: int
) -> None:
    bench = Bench(three_floors())
    bench.world.cars["blue"], bench.world.where["blue"] = CAR, Aboard(ROBOT)
    bench.oracle.take_stock()
    board(bench, target_mm=target_mm)
    assert bench.world.standing_position(ROBOT) == Segment(1, index)
    bench.drive(FLOOR_MM, 1, lift, for_us=3 * SECOND)
    assert bench.world.is_riding(ROBOT) and bench.world.aboard(lift) == ROBOT
    assert bench.world.standing_position(ROBOT) is None
    assert bench.world.at_mark(ROBOT), "the mark of the platform rides along"
    ride(bench, lift, 2, 1)
    assert bench.world.standing_position(ROBOT) == Segment(2, index)
    assert bench.position_mm() == target_mm, "the drive's position stays the same"
    bench.drive_to_index(3, 2)
    assert bench.world.standing_segment(ROBOT) == Segment(2, 3)
    assert bench.world.where["blue"] == Aboard(ROBOT)
    assert bench.rules == []


def test_after_a_ride_to_a_shorter_alley_the_drive_tells_its_position_there() -> None:
    site = three_floors(upper=5)
    # Where the platform is no position that all floors have, each alley has its own stretch of the tape.
    at_first_mm, at_third_mm = (
        site.tracks[track].origin_mm + site.position_mm(Segment(track, index)) for track, index in ((1, 7), (3, 6))
    )
    assert at_first_mm != at_third_mm
    bench = Bench(site)
    bench.drive(at_first_mm, 1, for_us=20 * SECOND)
    ride(bench, RIGHT, 3, 1)
    assert bench.world.standing_position(ROBOT) == Segment(3, 6)
    assert bench.links[ROBOT].last(DriveState).position_mm == at_third_mm
    ride(bench, RIGHT, 1, 2)
    assert bench.links[ROBOT].last(DriveState).position_mm == at_first_mm
    assert bench.rules == []


def test_an_empty_platform_passes_by_carriers_that_stand_at_its_sills() -> None:
    bench = Bench(three_floors(home="p(2,2)"))
    bench.drive(0, 1)
    ride(bench, LEFT, 3, 1)
    ride(bench, LEFT, 1, 2)
    assert bench.world.standing_segment(ROBOT) == Segment(2, 1)
    assert bench.rules == []


# --- what a carrier's drive refuses ---------------------------------------------------------------------------------


@pytest.mark.parametrize("target_mm", [AT_LEFT_MM, AT_RIGHT_MM, -1, 5 * 2400 + 1])
def test_the_shaft_gate_is_shut_where_no_platform_stands(target_mm: int) -> None:
    bench = Bench(three_floors(home="p(2,2)"))
    bench.drive(target_mm, 1, for_us=2 * SECOND)
    assert bench.position_mm() == 2400
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.FAULT
    ride(bench, LEFT, 2, 1)
    ride(bench, RIGHT, 2, 1)
    bench.drive(target_mm, 2)
    assert bench.position_mm() == target_mm
    assert bench.rules == []


def test_a_platform_beyond_its_stop_is_no_way_on() -> None:
    bench = Bench(three_floors())
    bench.drive(AT_LEFT_MM - 1, 1, for_us=2 * SECOND)
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.FAULT
    assert bench.position_mm() == 2400


def test_a_carrier_on_its_way_to_a_platform_that_leaves_brakes_at_once() -> None:
    bench = Bench(three_floors(home="p(1,5)"))
    bench.drive(AT_LEFT_MM, 1, for_us=3 * SECOND)
    now_us = bench.timers.now_us()
    position_mm, speed_mm_s = bench.world.robots[ROBOT].motion.at(now_us)
    bench.links[LEFT].order(DriveOrder(LEFT, 1, FLOOR_MM, 1083))
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.FAULT
    bench.timers.run_for(10 * SECOND)
    assert bench.position_mm() == pytest.approx(position_mm - speed_mm_s**2 / (2 * 500), abs=0.1)
    assert bench.rules == []


def test_a_carrier_does_not_move_on_a_platform_between_floors() -> None:
    bench = Bench(three_floors())
    board(bench)
    bench.drive(FLOOR_MM, 1, LEFT, for_us=2 * SECOND)
    bench.drive(0, 2, for_us=SECOND)
    assert bench.position_mm() == AT_LEFT_MM
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.FAULT
    assert "between two floors" in bench.carriers[ROBOT].fault
    ride(bench, LEFT, 2, 2)
    bench.drive(0, 3)
    assert bench.world.standing_segment(ROBOT) == Segment(2, 1)
    assert bench.rules == []


@pytest.mark.parametrize("lift_moves", [False, True])
def test_the_shuttle_stays_home_on_a_platform(lift_moves: bool) -> None:
    bench = Bench(three_floors())
    board(bench)
    if lift_moves:
        bench.drive(FLOOR_MM, 1, LEFT, for_us=2 * SECOND)
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 1, ShuttleAction.REACH, Side.FAR, 2700))
    bench.timers.run_for(SECOND)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.FAULT
    assert bench.world.robots[ROBOT].extension.final_mm == 0
    assert bench.rules == []

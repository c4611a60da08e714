"""The oracle finds every hazard that devices without their interlocks would make; the world lets them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus_sim.systems.car_park.plant.motion import driving, standing
from bus_sim.systems.car_park.plant.oracle import least_distance
from onboard.contract.codes import DoorName, DoorPosition, ShuttleAction, Side
from onboard.core.site import Station
from tests.plant.support import CAR, COMPARTMENT, ROBOT, SECOND, Bench
from tests.sites import one_floor

FAR_12 = Station(1, 12, Side.FAR)
BAY = Station(1, 4, Side.NEAR)


def move(bench: Bench, target_mm: float, node: int = ROBOT) -> None:
    now_us = bench.timers.now_us()
    position_mm, speed = bench.world.robots[node].motion.at(now_us)
    bench.world.move_carrier(node, driving(position_mm, speed, target_mm, 1500, 500, now_us))


def reach(bench: Bench, side: Side, extension_mm: float = 5400) -> None:
    bench.world.move_shuttle(ROBOT, driving(0, 0, extension_mm, 750, 500, bench.timers.now_us()), side)


def test_a_quiet_site_is_faultless() -> None:
    bench = Bench(one_floor(3))
    bench.timers.run_until(100 * SECOND)
    assert bench.rules == []


def test_p32_moving_with_the_shuttle_out() -> None:
    bench = Bench()
    reach(bench, Side.FAR)
    bench.timers.run_for(SECOND)
    move(bench, 0)
    assert bench.rules == ["SHUTTLE_HOME_TO_MOVE"]


def test_p32_an_order_that_would_tear_counts_though_the_drive_refuses_it() -> None:
    bench = Bench()
    reach(bench, Side.FAR)
    bench.timers.run_for(20 * SECOND)
    where_mm = round(bench.position_mm())
    bench.drive(where_mm, sequence=1, for_us=SECOND)
    assert bench.rules == [], "to where it stands it may be ordered"
    bench.drive(where_mm - 2_400, sequence=2, for_us=SECOND)
    assert bench.position_mm() == where_mm
    assert bench.rules == ["ORDER_TO_TEAR"]


def test_two_bodies_meeting_between_two_events_are_found() -> None:
    bench = Bench(one_floor(2))
    # The lower one dashes at the upper one and is back before anybody looks.
    now = bench.timers.now_us()
    move(bench, 26_400 - 2_250, node=12)
    bench.timers.run_for(3 * SECOND)
    position_mm = bench.world.robots[12].motion.at(bench.timers.now_us())[0]
    bench.world.move_carrier(12, driving(position_mm, 0, 0, 1500, 500, bench.timers.now_us()))
    bench.timers.run_for(30 * SECOND)
    violations = bench.oracle.finish()
    assert [violation.rule.name for violation in violations] == ["BODIES_APART"]
    assert "2250.0 mm apart" in violations[0].text
    assert now < violations[0].time_us <= 3 * SECOND


def test_carriers_may_touch_but_not_overlap() -> None:
    bench = Bench(one_floor(2))
    move(bench, 26_400 - 2_300, node=12)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == []
    move(bench, 26_400 - 2_299, node=12)
    bench.timers.run_for(10 * SECOND)
    assert bench.rules == ["BODIES_APART"]


def test_leaving_the_track() -> None:
    bench = Bench()
    move(bench, 26_400 + 1_201)
    bench.timers.run_for(60 * SECOND)
    assert bench.rules == ["ON_TRACK"]


@pytest.mark.parametrize("other", [position for position in DoorPosition if position is not DoorPosition.LOCKED])
def test_both_doors_not_locked(other: DoorPosition) -> None:
    bench = Bench()
    bench.world.set_door(COMPARTMENT, DoorName.INPUT, DoorPosition.OPEN)
    bench.world.set_door(COMPARTMENT, DoorName.OUTPUT, other)
    assert bench.rules == ["ONE_DOOR"]


def test_p60_a_person_inside_with_the_output_door_unlocked() -> None:
    bench = Bench()
    bench.world.set_door(COMPARTMENT, DoorName.INPUT, DoorPosition.OPEN)
    bench.world.person_enters(COMPARTMENT)
    bench.world.set_door(COMPARTMENT, DoorName.INPUT, DoorPosition.LOCKED)
    assert bench.rules == []
    bench.world.set_door(COMPARTMENT, DoorName.OUTPUT, DoorPosition.OPENING)
    assert bench.rules == ["NO_PERSON_TO_MACHINES"]


def test_a_person_through_a_shut_door() -> None:
    bench = Bench()
    bench.world.person_enters(COMPARTMENT)
    assert bench.rules == ["PERSON_BY_OPEN_DOOR"]


@pytest.mark.parametrize("output", [DoorPosition.LOCKED, DoorPosition.OPENING, DoorPosition.CLOSING])
def test_a_shuttle_in_a_bay_whose_door_is_not_open(output: DoorPosition) -> None:
    bench = Bench()
    bench.drive_to_index(4, 1)
    bench.world.set_door(COMPARTMENT, DoorName.OUTPUT, output)
    reach(bench, Side.NEAR)
    assert bench.rules == ["BAY_BY_OPEN_DOOR"]


def test_a_shuttle_between_marks_hits_the_wall() -> None:
    bench = Bench()
    bench.drive(25_000, 1)
    reach(bench, Side.FAR)
    assert bench.rules == ["NO_WALL"]


def test_a_second_car_into_one_place() -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.shuttle(ShuttleAction.GRIP, 2)
    bench.shuttle(ShuttleAction.RETRACT, 3)
    bench.world.cars["red"] = CAR
    bench.world.where["red"] = FAR_12
    bench.oracle.take_stock()
    bench.shuttle(ShuttleAction.REACH, 4)
    assert bench.rules == ["ONE_CAR"]


@pytest.mark.parametrize("where", [None, Station(1, 9, Side.NEAR)])
def test_a_car_that_jumps(where: Station | None) -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.world.where["blue"] = where
    assert bench.rules == ["CARS_CONSERVED"]


def test_a_car_that_vanishes() -> None:
    bench = Bench()
    bench.store(FAR_12)
    del bench.world.where["blue"]
    assert bench.rules == ["CARS_CONSERVED"]


def test_a_violation_that_lasts_is_told_once_and_again_when_it_comes_back() -> None:
    bench = Bench()
    bench.world.set_door(COMPARTMENT, DoorName.INPUT, DoorPosition.OPEN)
    for position in (DoorPosition.OPENING, DoorPosition.OPENING, DoorPosition.LOCKED, DoorPosition.OPENING):
        bench.world.set_door(COMPARTMENT, DoorName.OUTPUT, position)
    assert bench.rules == ["ONE_DOOR", "ONE_DOOR"]


spots = st.floats(-10_000, 10_000)
speeds = st.floats(-1500, 1500)


@given(spots, speeds, spots, spots, speeds, spots, st.integers(0, 3_000_000))
def test_least_distance_agrees_with_sampling(
    x1: float, v1: float, t1: float, x2: float, v2: float, t2: float, later_us: int
) -> None:
    one = driving(x1, v1, t1, 1500, 500, 0)
    two = driving(x2, v2, t2, 1200, 400, later_us)
    end_us = max(one.end_us, two.end_us) + 1_000_000
    gap_mm, at_us = least_distance(one, two, later_us, end_us)
    steps = 2_000
    samples = [later_us + (end_us - later_us) * n // steps for n in range(steps + 1)]
    sampled_mm = min(abs(one.at(t)[0] - two.at(t)[0]) for t in samples)
    assert gap_mm <= sampled_mm + 1e-2
    # Between two samples the distance changes by at most the speeds' sum times half a step.
    step_s = (end_us - later_us) / steps / 1e6
    assert gap_mm >= sampled_mm - 3_000 * step_s - 1e-2
    assert later_us <= at_us <= end_us
    assert abs(one.at(at_us)[0] - two.at(at_us)[0]) == pytest.approx(gap_mm, abs=1e-2)


def test_least_distance_of_bodies_at_rest() -> None:
    assert least_distance(standing(0, 0), standing(2400, 0), 5, 5) == (2400, 5)

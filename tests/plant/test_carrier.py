"""The drive: moves only on fresh orders, stops by itself, never with the shuttle out."""

import pytest

from onboard.contract.codes import DriveMode, ShuttleAction, ShuttleMode
from onboard.contract.messages import DriveOrder, DriveState, ShuttleState
from tests.plant.support import ROBOT, SECOND, Bench
from tests.sites import one_floor

HOME_MM = 11 * 2400


def test_arrives_at_the_mark_and_says_so() -> None:
    bench = Bench()
    bench.drive(0, 1)
    said = bench.links[ROBOT].all(DriveState)
    arrival_us, arrival = next((t, s) for t, s in said if t and s.mode is DriveMode.STANDING)
    assert (arrival.position_mm, arrival.speed_mm_s, arrival.at_mark, arrival.sequence) == (0, 0, True, 1)
    # 26400 mm at 1500 mm/s and 500 mm/s^2: 17.6 + 3 s.
    assert arrival_us == 20_600_000
    assert bench.rules == []


def test_tells_every_middle_and_border_it_passes_and_little_else() -> None:
    bench = Bench()
    bench.drive(0, 1)
    moving = [s for _, s in bench.links[ROBOT].all(DriveState) if s.mode is DriveMode.MOVING]
    positions = [state.position_mm for state in moving]
    assert positions[:3] == [HOME_MM, HOME_MM - 1200, HOME_MM - 2400]
    assert set(positions) >= set(range(1200, HOME_MM + 1, 1200))
    # One at the start, 21 passages, and at most two slow repeats in 20 s.
    assert len(moving) <= 24
    assert all(state.at_mark == (state.position_mm % 2400 == 0) for state in moving[1:] if not state.position_mm % 1200)


def test_says_nothing_while_idle_but_a_slow_repeat() -> None:
    bench = Bench()
    bench.timers.run_until(100 * SECOND)
    assert [t for t, _ in bench.links[ROBOT].all(DriveState)] == [n * 10 * SECOND for n in range(11)]


@pytest.mark.parametrize("silent_from_us", [1_000_000, 6_000_000, 18_000_000])
def test_brakes_by_itself_when_orders_stop(silent_from_us: int) -> None:
    bench = Bench()
    bench.drive(0, 1, for_us=silent_from_us)
    last_order_us = silent_from_us - 200_000
    bench.timers.run_until(last_order_us + 499_999)
    assert bench.carriers[ROBOT].mode is DriveMode.MOVING
    start_mm, speed = bench.world.robots[ROBOT].motion.at(last_order_us + 500_000)
    bench.timers.run_until(last_order_us + 500_000)
    assert bench.carriers[ROBOT].mode is DriveMode.BRAKING
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.BRAKING
    bench.timers.run_for(30 * SECOND)
    assert bench.position_mm() == pytest.approx(start_mm - speed * speed / (2 * 500), abs=0.1)
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.STANDING


def test_a_repeated_order_resumes_a_drive_that_had_braked() -> None:
    bench = Bench()
    bench.drive(0, 1, for_us=3 * SECOND)
    bench.timers.run_for(10 * SECOND)
    assert 0 < bench.position_mm() < HOME_MM
    bench.drive(0, 1)
    assert bench.position_mm() == 0


def test_the_target_may_be_moved_on_and_back_while_moving() -> None:
    bench = Bench()
    bench.drive(HOME_MM - 4800, 1, for_us=3 * SECOND)
    bench.drive(0, 2, for_us=5 * SECOND)
    bench.drive(9600, 3)
    assert bench.position_mm() == 9600
    assert bench.rules == []


def test_an_older_sequence_is_passed_over_while_the_stream_lives() -> None:
    bench = Bench()
    bench.drive(0, 5, for_us=2 * SECOND)
    bench.links[ROBOT].order(DriveOrder(ROBOT, 4, HOME_MM, 1500))
    assert bench.carriers[ROBOT].stale_orders == 1
    bench.drive(0, 5)
    assert bench.position_mm() == 0


def test_a_controller_that_started_again_may_count_from_one() -> None:
    bench = Bench()
    bench.drive(HOME_MM - 2400, 100)
    bench.timers.run_for(SECOND)
    bench.drive(HOME_MM, 1)
    assert bench.position_mm() == HOME_MM


def test_speed_limit_is_kept_and_zero_stops() -> None:
    bench = Bench()
    bench.links[ROBOT].order(DriveOrder(ROBOT, 1, 0, 300))
    bench.timers.run_for(490_000)
    for _ in range(20):
        bench.links[ROBOT].order(DriveOrder(ROBOT, 1, 0, 300))
        bench.timers.run_for(200_000)
    assert bench.world.robots[ROBOT].motion.at(bench.timers.now_us())[1] == -300
    bench.links[ROBOT].order(DriveOrder(ROBOT, 2, 0, 0))
    bench.timers.run_for(2 * SECOND)
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.STANDING


@pytest.mark.parametrize("target_mm", [-1, HOME_MM + 1, 2**31 - 1])
def test_a_target_off_the_track_is_refused_visibly(target_mm: int) -> None:
    bench = Bench()
    bench.drive(target_mm, 1, for_us=2 * SECOND)
    assert bench.position_mm() == HOME_MM
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.FAULT
    assert "end of the track" in bench.carriers[ROBOT].fault
    bench.drive(0, 2)
    assert bench.position_mm() == 0


def test_p32_the_carrier_does_not_move_while_the_shuttle_is_out() -> None:
    bench = Bench()
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.drive(0, 1, for_us=2 * SECOND)
    assert bench.position_mm() == HOME_MM
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.FAULT
    assert bench.carriers[ROBOT].fault == "the shuttle is out"
    bench.shuttle(ShuttleAction.RETRACT, 2)
    assert bench.links[ROBOT].last(DriveState).mode is DriveMode.STANDING
    bench.drive(0, 2)
    assert bench.position_mm() == 0
    assert bench.rules == ["ORDER_TO_TEAR"], "the order was given all the same"


def test_p32_the_shuttle_does_not_leave_a_moving_carrier() -> None:
    bench = Bench()
    bench.drive(0, 1, for_us=3 * SECOND)
    bench.shuttle(ShuttleAction.REACH, 1)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.FAULT
    assert bench.links[ROBOT].last(ShuttleState).extension_mm == 0
    assert bench.rules == []


def test_two_carriers_keep_to_themselves() -> None:
    bench = Bench(one_floor(2))
    bench.drive(2400, 1, node=12)
    assert bench.position_mm(12) == 2400
    assert bench.position_mm(11) == HOME_MM

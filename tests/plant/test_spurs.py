"""Turning into spurs: what the drive does on which orders, and what the oracle finds where interlocks are missing."""

import pytest

from bus_sim.systems.car_park.plant.motion import driving, standing
from onboard.contract.codes import DriveMode, ShuttleAction, ShuttleMode, Side
from onboard.contract.messages import DriveOrder, DriveState, ShuttleState
from onboard.core.site import Segment
from tests.plant.support import ROBOT, SECOND, Bench
from tests.sites import one_floor

OTHER = 12
PITCH_MM = 2_400
MOUTH_MM = 6 * PITCH_MM
TURN_US = 3 * SECOND
SPUR = 192


def bench_at(index: int = 7, other: int = 11) -> Bench:
    """MR1 at p(1,index) of an alley with a spur at p(1,7), MR2 at p(1,other)."""
    bench = Bench(one_floor(2, extra=f'[[spurs]]\nat = "p(1,7)"\n[carrier]\nturn_ms = {TURN_US // 1000}\n'))
    place(bench, ROBOT, index)
    place(bench, OTHER, other)
    return bench


def place(bench: Bench, node: int, index: int) -> None:
    bench.world.move_carrier(node, standing((index - 1) * float(PITCH_MM), bench.timers.now_us()))


def order(bench: Bench, target_mm: int, sequence: int, *, across: bool, for_us: int = 20 * SECOND) -> None:
    end_us = bench.timers.now_us() + for_us
    while bench.timers.now_us() < end_us:
        bench.links[ROBOT].order(DriveOrder(ROBOT, sequence, target_mm, 1500, across))
        bench.timers.run_for(200_000)


def inside(bench: Bench) -> None:
    order(bench, 0, 1, across=True)
    assert bench.world.standing_position(ROBOT) == Segment(SPUR, 1)


def test_a_carrier_turns_in_the_mouth_and_drives_in() -> None:
    bench = bench_at()
    inside(bench)
    said = [(s.mode, s.across, s.position_mm) for _, s in bench.links[ROBOT].all(DriveState)]
    turning = said.index((DriveMode.TURNING, False, MOUTH_MM))
    assert said[turning + 1 : turning + 3] == [
        (DriveMode.STANDING, True, -PITCH_MM),
        (DriveMode.MOVING, True, -PITCH_MM),
    ]
    assert said[-1] == (DriveMode.STANDING, True, 0)
    times = {s.mode: at for at, s in reversed(bench.links[ROBOT].all(DriveState))}
    assert times[DriveMode.MOVING] - times[DriveMode.TURNING] == TURN_US
    assert bench.rules == []


def test_a_carrier_drives_out_and_turns_back() -> None:
    bench = bench_at()
    inside(bench)
    order(bench, -PITCH_MM, 2, across=True, for_us=8 * SECOND)
    assert bench.world.standing_position(ROBOT) == Segment(SPUR, 0)
    order(bench, MOUTH_MM + PITCH_MM, 3, across=False)
    assert bench.world.standing_position(ROBOT) == Segment(1, 8)
    assert bench.rules == []


def test_a_turn_is_ended_though_orders_stop() -> None:
    bench = bench_at()
    order(bench, 0, 1, across=True, for_us=SECOND)
    assert bench.carriers[ROBOT].mode is DriveMode.TURNING
    bench.timers.run_for(60 * SECOND)
    state = bench.links[ROBOT].last(DriveState)
    assert (state.mode, state.across, state.position_mm) == (DriveMode.STANDING, True, -PITCH_MM)


@pytest.mark.parametrize("index", [6, 12])
def test_a_carrier_refuses_to_turn_elsewhere(index: int) -> None:
    bench = bench_at(index, other=2)
    order(bench, 0, 1, across=True)
    assert bench.carriers[ROBOT].mode is DriveMode.FAULT
    assert "mouth" in bench.carriers[ROBOT].fault
    assert bench.world.robots[ROBOT].track == 1


def test_a_carrier_in_a_spur_refuses_the_alley_and_what_is_beyond_its_mouth() -> None:
    bench = bench_at()
    inside(bench)
    order(bench, MOUTH_MM, 2, across=False)
    assert bench.carriers[ROBOT].mode is DriveMode.FAULT
    order(bench, -2 * PITCH_MM, 3, across=True)
    assert bench.carriers[ROBOT].mode is DriveMode.FAULT
    assert bench.position_mm() == 0


def test_the_shuttle_stays_in_while_the_carrier_turns_and_in_the_spur() -> None:
    bench = bench_at()
    order(bench, 0, 1, across=True, for_us=SECOND)
    bench.shuttle(ShuttleAction.REACH, 1, Side.NEAR)
    assert bench.links[ROBOT].last(ShuttleState).mode is ShuttleMode.FAULT
    assert bench.rules == []


def test_a_carrier_does_not_turn_with_its_shuttle_out() -> None:
    bench = bench_at()
    bench.shuttle(ShuttleAction.REACH, 1, Side.NEAR)
    order(bench, 0, 1, across=True)
    assert bench.world.robots[ROBOT].track == 1
    assert bench.rules == ["ORDER_TO_TEAR"], "the order was given all the same"


# --- without the interlocks: moved by hand in the world -------------------------------------------------------------


def enter(bench: Bench, from_mm: float, to_mm: float) -> None:
    """MR1 on the spur's axis at ``from_mm``, driving to ``to_mm``, though no device would."""
    now_us = bench.timers.now_us()
    bench.world.end_turn(ROBOT, Segment(SPUR, 0))
    bench.world.move_carrier(ROBOT, standing(from_mm, now_us))
    bench.world.move_carrier(ROBOT, driving(from_mm, 0.0, to_mm, 1500, 500, now_us))


def test_whoever_comes_into_the_mouth_while_another_is_over_its_border_is_found() -> None:
    bench = bench_at(other=10)
    enter(bench, -PITCH_MM, -1_000.0)
    bench.timers.run_for(10 * SECOND)
    now_us = bench.timers.now_us()
    bench.world.move_carrier(OTHER, driving(9.0 * PITCH_MM, 0.0, MOUTH_MM + 2_200.0, 1500, 500, now_us))
    bench.timers.run_for(20 * SECOND)
    assert bench.rules == ["BODIES_APART"]


def test_whoever_passes_the_mouth_while_another_is_wholly_inside_is_not() -> None:
    bench = bench_at(other=10)
    enter(bench, -PITCH_MM, 0.0)
    bench.timers.run_for(10 * SECOND)
    bench.world.move_carrier(OTHER, driving(9.0 * PITCH_MM, 0.0, 0.0, 1500, 500, bench.timers.now_us()))
    bench.timers.run_for(30 * SECOND)
    assert bench.rules == []


def test_whoever_passes_just_before_the_other_comes_out_is_not_and_a_moment_later_is() -> None:
    found = []
    # MR2 passes the mouth from 7,800 mm before it; MR1 begins to come out so much later.
    for late_s in (10.0, 2.0):
        bench = bench_at(other=10)
        enter(bench, -PITCH_MM, 0.0)
        bench.timers.run_for(10 * SECOND)
        bench.world.move_carrier(OTHER, driving(9.0 * PITCH_MM, 0.0, 0.0, 1500, 500, bench.timers.now_us()))
        bench.timers.run_for(round(late_s * SECOND))
        bench.world.move_carrier(ROBOT, driving(0.0, 0.0, -PITCH_MM, 1500, 500, bench.timers.now_us()))
        bench.timers.run_for(30 * SECOND)
        found.append(bench.rules)
    assert found == [[], ["BODIES_APART"]]


def test_a_turn_towards_a_spur_in_which_another_stands_is_found() -> None:
    bench = bench_at(index=5)
    bench.world.end_turn(OTHER, Segment(SPUR, 0))
    bench.world.move_carrier(OTHER, standing(0.0, bench.timers.now_us()))
    place(bench, ROBOT, 7)
    assert bench.rules == []
    bench.world.begin_turn(ROBOT, SPUR)
    bench.timers.run_for(SECOND)
    assert bench.rules == ["BODIES_APART"]


def test_a_turn_elsewhere_than_in_the_mouth_is_found() -> None:
    bench = bench_at(index=6)
    bench.world.begin_turn(ROBOT, SPUR)
    bench.timers.run_for(SECOND)
    assert bench.rules == ["TURN_IN_MOUTH"]


def test_a_turn_with_the_shuttle_out_is_found() -> None:
    bench = bench_at()
    bench.world.move_shuttle(ROBOT, standing(5_400.0, bench.timers.now_us()), Side.NEAR)
    bench.world.begin_turn(ROBOT, SPUR)
    bench.timers.run_for(SECOND)
    assert bench.rules == ["SHUTTLE_HOME_TO_MOVE"]


def test_a_carrier_that_leaves_the_end_of_its_spur_is_found() -> None:
    bench = bench_at()
    enter(bench, -PITCH_MM, 1_500.0)
    bench.timers.run_for(20 * SECOND)
    assert bench.rules == ["ON_TRACK"]

"""The shuttle: reach, grip by the wheelbase, lift, retract, and what it refuses."""

import pytest

from bus_sim.systems.car_park.plant.bodies import Aboard, CarBody
from onboard.contract.codes import ShuttleAction, ShuttleMode, Side
from onboard.contract.messages import ShuttleOrder, ShuttleState
from onboard.core.site import Station
from tests.plant.support import CAR, ROBOT, SECOND, Bench

FAR_12 = Station(1, 12, Side.FAR)


def states(bench: Bench) -> list[ShuttleMode]:
    return [state.mode for time_us, state in bench.links[ROBOT].all(ShuttleState) if time_us % (10 * SECOND)]


def test_takes_a_car_aboard_and_leaves_it_elsewhere() -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.timers.run_for(1)
    for sequence, action in enumerate((ShuttleAction.REACH, ShuttleAction.GRIP, ShuttleAction.RETRACT), 1):
        bench.shuttle(action, sequence)
    was = [bench.world.where["blue"]]
    assert bench.links[ROBOT].last(ShuttleState).load_kg == CAR.mass_kg
    bench.drive_to_index(9, 1)
    for sequence, action in enumerate((ShuttleAction.REACH, ShuttleAction.RELEASE, ShuttleAction.RETRACT), 4):
        bench.shuttle(action, sequence)
    assert [*was, bench.world.where["blue"]] == [Aboard(ROBOT), Station(1, 9, Side.FAR)]
    last = bench.links[ROBOT].last(ShuttleState)
    assert (last.mode, last.load_kg, last.extension_mm) == (ShuttleMode.HOME, 0, 0)
    changes = [mode.name for mode in dict.fromkeys(states(bench))]
    assert changes == ["MOVING", "REACHED", "GRIPPING", "HOME", "RELEASING"]
    assert bench.rules == []


def test_strokes_and_grips_take_their_time() -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 1, ShuttleAction.REACH, Side.FAR, 2700))
    # 5400 mm at 750 mm/s and 500 mm/s^2: 7.2 + 1.5 s.
    bench.timers.run_until(8_699_999)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.MOVING
    bench.timers.run_until(8_700_000)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.REACHED
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 2, ShuttleAction.GRIP, Side.FAR, 2700))
    bench.timers.run_until(10_699_999)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.GRIPPING
    bench.timers.run_until(10_700_000)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.REACHED


@pytest.mark.parametrize("wheelbase_mm", [2650, 2750])
def test_p33_grips_within_the_tolerance(wheelbase_mm: int) -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.shuttle(ShuttleAction.GRIP, 2, wheelbase_mm=wheelbase_mm)
    assert bench.world.where["blue"] == Aboard(ROBOT)


@pytest.mark.parametrize(
    ("wheelbase_mm", "word"), [(2640, "wheelbase"), (2760, "wheelbase"), (1799, "range"), (3401, "range")]
)
def test_p33_another_wheelbase_is_refused_and_the_car_stays(wheelbase_mm: int, word: str) -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.shuttle(ShuttleAction.GRIP, 2, wheelbase_mm=wheelbase_mm)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.FAULT
    assert word in bench.shuttles[ROBOT].fault
    assert bench.world.where["blue"] == FAR_12
    bench.shuttle(ShuttleAction.RETRACT, 3)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.HOME


@pytest.mark.parametrize("wheelbase_mm", [1800, 3400])
def test_p33_small_and_large_cars_are_both_taken(wheelbase_mm: int) -> None:
    bench = Bench()
    bench.store(FAR_12, CarBody("odd", wheelbase_mm, 4300, 1500, 1400))
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.shuttle(ShuttleAction.GRIP, 2, wheelbase_mm=wheelbase_mm)
    assert bench.world.where["odd"] == Aboard(ROBOT)


def test_gripping_nothing_is_a_fault() -> None:
    bench = Bench()
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.shuttle(ShuttleAction.GRIP, 2)
    assert bench.shuttles[ROBOT].fault == "no car to grip"


@pytest.mark.parametrize("action", [ShuttleAction.GRIP, ShuttleAction.RELEASE])
def test_what_needs_the_shuttle_out_is_refused_at_home(action: ShuttleAction) -> None:
    bench = Bench()
    bench.shuttle(action, 1)
    assert bench.shuttles[ROBOT].mode is ShuttleMode.FAULT


def test_a_repeated_order_is_answered_and_starts_nothing() -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.shuttle(ShuttleAction.GRIP, 2)
    before = len(bench.links[ROBOT].all(ShuttleState))
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 2, ShuttleAction.GRIP, Side.FAR, 2700))
    assert bench.shuttles[ROBOT].mode is ShuttleMode.REACHED
    assert len(bench.links[ROBOT].all(ShuttleState)) == before + 1


def test_an_order_during_gripping_is_passed_over_and_its_sequence_not_taken_up() -> None:
    bench = Bench()
    bench.store(FAR_12)
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 2, ShuttleAction.GRIP, Side.FAR, 2700))
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 3, ShuttleAction.RETRACT, Side.FAR, 2700))
    bench.timers.run_for(5 * SECOND)
    assert bench.links[ROBOT].last(ShuttleState).sequence == 2
    assert bench.shuttles[ROBOT].busy_refusals == 1
    assert bench.shuttles[ROBOT].mode is ShuttleMode.REACHED


def test_retract_turns_a_stroke_round_at_once() -> None:
    bench = Bench()
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 1, ShuttleAction.REACH, Side.FAR, 2700))
    bench.timers.run_for(3 * SECOND)
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 2, ShuttleAction.RETRACT, Side.FAR, 2700))
    bench.timers.run_for(10 * SECOND)
    last = bench.links[ROBOT].last(ShuttleState)
    assert (last.mode, last.sequence, last.extension_mm) == (ShuttleMode.HOME, 2, 0)


def test_the_shuttle_stays_in_between_marks() -> None:
    bench = Bench()
    bench.drive(26_400 - 1_000, 1)
    bench.shuttle(ShuttleAction.REACH, 1)
    assert bench.shuttles[ROBOT].fault == "the carrier does not stand at a mark"
    assert bench.rules == []


def test_what_has_refused_and_has_not_begun_is_home_as_soon_as_it_is_told_to_be() -> None:
    """A checker took it for in the bay whose door was closed (corner, pushes, seed 50417)."""
    bench = Bench()
    bench.drive(26_400 - 1_000, 1)
    bench.shuttle(ShuttleAction.REACH, 1)
    bench.links[ROBOT].order(ShuttleOrder(ROBOT, 2, ShuttleAction.RETRACT, Side.FAR, 2700))
    assert [state.mode for _, state in bench.links[ROBOT].all(ShuttleState)][-2:] == [
        ShuttleMode.FAULT,
        ShuttleMode.HOME,
    ]

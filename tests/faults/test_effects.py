"""What each kind of fault does to the simulated world, seen on the buses and on the bodies."""

from functools import partial
from itertools import pairwise

import pytest

from bus_sim.systems.car_park.plant.customer import CustomerState, VisitOutcome
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import DeskInput, DoorName, DoorPosition, MachineState, ManualMode, Reason
from onboard.contract.messages import DeskEvent, DriveOrder, DriveState, Halted, Heartbeat, ManualState
from onboard.core.frame import Frame
from onboard.core.journal_state import JournalState
from onboard.ports.bus import ErrorState
from tests.faults.world import Seen, watch

ROBOT, COMPARTMENT = 11, 1


def _position_mm(seen: Seen) -> float:
    return seen.simulation.plant.world.robots[ROBOT].motion.final_mm


def _states(seen: Seen, from_s: float = 0, to_s: float = 1e9) -> list[DriveState]:
    return [m for t, m in seen.device if isinstance(m, DriveState) and from_s * 1e6 <= t < to_s * 1e6]


def _note(times: list[int], _: Frame, time_us: int) -> None:
    times.append(time_us)


# --- the bus ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", ["burst:at_s=20,for_s=2", "bit_errors:at_s=15,for_s=30,probability=0.5"])
def test_destroyed_frames_are_error_frames_on_the_bus(fault: str) -> None:
    assert watch(fault, seconds=50).simulation.fleet.statistics().error_frames > 5
    assert watch(seconds=50).simulation.fleet.statistics().error_frames == 0


def test_a_sender_whose_frames_fail_goes_off_the_bus_and_its_stale_frames_come_later() -> None:
    # Each frame that goes out takes one off its count: it says fewer than one a second.
    seen = watch("bus_off:target=MR1,at_s=20,for_s=5", seconds=170, look=(24.9, lambda s: s.fleet_node("MR1")))
    assert seen.said_by(ROBOT, 20.0, 25.0) == 0
    assert seen.said_by(ROBOT, 25.0, 40.0) > 0
    errors = seen.simulation.fleet.statistics().error_frames
    assert errors >= 32, "eight on TEC for each: off the bus after 32"
    node = seen.simulation.fleet_node("MR1")
    assert node is not None
    assert node.health().state is ErrorState.ERROR_ACTIVE


@pytest.mark.parametrize(
    ("way", "robot_hears", "compartment_hears"), [("both", False, False), ("out", True, False), ("in", False, True)]
)
def test_a_partition_cuts_the_ways_that_it_names(way: str, robot_hears: bool, compartment_hears: bool) -> None:
    heard: dict[int, list[int]] = {ROBOT: [], COMPARTMENT: []}

    def listen(simulation: Simulation) -> None:
        for node, times in heard.items():
            bus = simulation.controllers[node].ports.fleet_bus
            bus.subscribe(partial(_note, times))

    watch(f"partition:members=MR1,at_s=12,for_s=20,way={way}", seconds=32, look=(11.9, listen))
    for node, hears in ((ROBOT, robot_hears), (COMPARTMENT, compartment_hears)):
        assert any(time_us > 12_000_000 for time_us in heard[node]) is hears


def test_reordering_and_loss_strike_only_the_receivers_named() -> None:
    seen = watch(
        "lossy:receivers=MR1,at_s=12,for_s=30,probability=1",
        "reorder:receivers=IOC1,at_s=12,for_s=30,probability=1",
        seconds=40,
    )
    loss, delay = seen.simulation.fleet.injectors
    assert loss.struck > 0
    assert delay.struck > 0


def test_a_slow_processor_behind_a_short_queue_overflows() -> None:
    fault = "overflow:target=MR1,at_s=5,for_s=50,queue=1,processing_us=20000"
    node = watch(fault, seconds=50).simulation.fleet_node("MR1")
    assert node is not None
    assert node.health().receive_overflows > 0
    healed = watch(fault, seconds=60).simulation.fleet_node("MR1")
    assert healed is not None
    assert (healed.processing_us, healed.options.receive_queue) == (0, 1000)


def test_a_babbling_node_loads_the_bus_and_is_gone_afterwards() -> None:
    seen = watch("babble:at_s=12,for_s=3,rate_hz=1500", seconds=20)
    assert seen.simulation.fleet.statistics().worst_second_load > 0.4
    assert watch(seconds=20).simulation.fleet.statistics().worst_second_load < 0.2
    assert seen.simulation.controllers[ROBOT].holon.halted is None


def test_a_second_board_with_the_same_node_id_holds_the_machine_while_it_is_there() -> None:
    during = watch("double_id:target=MR1,at_s=12,for_s=5", seconds=16).simulation.controllers[ROBOT].holon
    assert during.holding.is_held
    assert during.halted is None
    after = watch("double_id:target=MR1,at_s=12,for_s=5", seconds=30).simulation.controllers[ROBOT].holon
    assert (after.holding.is_held, after.boot) == (False, 2)


# --- controllers and clocks ------------------------------------------------------------------------------------


def test_a_crashed_controller_is_silent_and_comes_back_with_the_next_boot_counter() -> None:
    seen = watch("crash:target=MR1,at_s=15,restart_s=10", seconds=40)
    assert seen.said_by(ROBOT, 15.0, 25.0) == 0
    assert seen.said_by(ROBOT, 25.0, 40.0) > 0
    assert seen.simulation.controllers[ROBOT].holon.boot == 2


def test_a_crash_without_a_restart_leaves_the_controller_off() -> None:
    seen = watch("crash:target=MR1,at_s=15,restart=no", seconds=30)
    assert ROBOT not in seen.simulation.controllers


def test_a_crash_at_the_third_frame_lets_two_frames_out() -> None:
    seen = watch("crash:target=MR1,at_s=20,frame=3,restart=no", seconds=80)
    frames = sum(t >= 20_000_000 and m.sender == ROBOT for t, m in [*seen.fleet, *seen.device] if not _is_state(m))
    assert frames <= 2
    assert ROBOT not in seen.simulation.controllers


def _is_state(message: object) -> bool:
    return type(message).__name__ in ("DriveState", "ShuttleState")


@pytest.mark.parametrize(("durable", "more"), [("no", 0), ("yes", 1)])
def test_a_crash_at_a_journal_write_strikes_before_or_after_it_is_durable(durable: str, more: int) -> None:
    def entries(simulation: Simulation) -> int:
        return len(simulation.journals[ROBOT].entries)

    seen = watch(f"crash:target=MR1,at_s=9,write=1,durable={durable},restart=no", seconds=80, look=(8.9, entries))
    assert ROBOT not in seen.simulation.controllers
    assert entries(seen.simulation) - int(str(seen.looks[0])) == more


@pytest.mark.parametrize(
    ("journal", "state", "lost"),
    [
        ("kept", JournalState.INTACT, 0),
        ("torn", JournalState.MENDED, 0),
        ("cut,entries=3", JournalState.MENDED, 0),
        ("flipped,entries=4", JournalState.MENDED, 0),
        ("unsealed", JournalState.SHORT, 0),
        ("foreign", JournalState.FOREIGN, 1_000),
        ("rolled_back,entries=2", JournalState.INTACT, 2),
        ("lost", JournalState.NEW, 1_000),
    ],
)
def test_a_journal_can_suffer_in_a_crash(journal: str, state: JournalState, lost: int) -> None:
    def entries(simulation: Simulation) -> int:
        return len(simulation.journals[ROBOT].entries)

    seen = watch(f"crash:target=MR1,at_s=59,restart=no,journal={journal}", seconds=60, look=(58.9, entries))
    before = int(str(seen.looks[0]))
    assert before > 4
    found = seen.simulation.journals[ROBOT]
    assert len(found.replay()) == max(0, before - lost)
    assert found.condition.state is state


@pytest.mark.parametrize(
    ("journal", "reason"), [("unsealed", Reason.JOURNAL_SHORT), ("foreign", Reason.JOURNAL_FOREIGN)]
)
def test_a_machine_whose_journal_is_not_reliable_says_so_and_holds(journal: str, reason: Reason) -> None:
    seen = watch(f"crash:target=MR1,at_s=59,restart_s=1,journal={journal}", seconds=80)
    said = [message for time, message in seen.fleet if message.sender == ROBOT and time > 60_000_000]
    held = [one for one in said if isinstance(one, Halted)]
    assert {(one.machine, one.reason, one.needs_person) for one in held} == {(ROBOT, reason, True)}
    assert len(held) > 5, "once in each heartbeat period: it lives"
    assert {one.state for one in said if isinstance(one, Heartbeat)} == {MachineState.OBSTACLE}
    assert seen.simulation.controllers[ROBOT].holon.halted is None


def test_a_paused_controller_says_nothing_and_then_goes_on() -> None:
    seen = watch("pause:target=MR1,at_s=15,for_s=8", seconds=40)
    assert seen.said_by(ROBOT, 15.1, 23.0) == 0
    assert seen.said_by(ROBOT, 23.0, 40.0) > 0
    assert seen.simulation.controllers[ROBOT].holon.boot == 1


def test_a_slow_node_needs_its_time_for_each_frame() -> None:
    seen = watch(
        "slow_node:target=MR1,at_s=15,processing_us=5000", seconds=20, look=(16, lambda s: s.fleet_node("MR1"))
    )
    node = seen.simulation.fleet_node("MR1")
    assert node is not None
    assert node.processing_us == 5000


def test_a_full_disk_stops_the_machine_until_there_is_room() -> None:
    seen = watch(
        "disk_full:target=MR1,at_s=9,for_s=60",
        seconds=100,
        look=(60, lambda s: s.controllers[ROBOT].holon.halted),
    )
    assert "no space left on device" in str(seen.looks[0])
    assert seen.simulation.controllers[ROBOT].holon.halted is None


def test_a_power_cut_silences_all_and_all_come_back() -> None:
    seen = watch("power_cut:at_s=15,for_s=10,spread_s=3", seconds=40)
    assert seen.said_by(ROBOT, 15.0, 25.0) == seen.said_by(COMPARTMENT, 15.0, 25.0) == 0
    assert sorted(seen.simulation.controllers) == [COMPARTMENT, ROBOT]


@pytest.mark.parametrize(
    ("fault", "more"), [("drift:target=IOC1,at_s=5,ppm=100000", True), ("drift:target=IOC1,at_s=5,ppm=-50000", False)]
)
def test_a_fast_clock_makes_heartbeats_come_sooner(fault: str, more: bool) -> None:
    def beats(seen: Seen) -> int:
        return sum(isinstance(m, Heartbeat) and m.sender == COMPARTMENT for _, m in seen.fleet)

    assert (beats(watch(fault, seconds=100, cars=0)) > beats(watch(seconds=100, cars=0))) is more


def test_a_clock_jump_brings_what_was_due_later_at_once() -> None:
    def beats(seen: Seen) -> list[int]:
        return [t for t, m in seen.fleet if isinstance(m, Heartbeat) and m.sender == COMPARTMENT and t > 20_300_000]

    jumped = watch("clock_jump:target=IOC1,at_s=20.2,by_ms=-3000", seconds=30, cars=0)
    assert beats(jumped)[0] - beats(watch(seconds=30, cars=0))[0] != 0


def _beats_of(seen: Seen, node: int) -> list[int]:
    return [t for t, m in seen.fleet if isinstance(m, Heartbeat) and m.sender == node]


def test_a_frozen_clock_lets_nothing_fall_due_and_goes_on_by_itself() -> None:
    beats = _beats_of(watch("clock_frozen:target=IOC1,at_s=5,for_s=20", seconds=40, cars=0), COMPARTMENT)
    assert [t for t in beats if 5_000_000 < t < 25_000_000] == []
    assert [t for t in beats if 25_000_000 <= t < 28_000_000]


def test_a_clock_that_drifts_is_at_its_rate_again_when_that_is_over() -> None:
    fast = _beats_of(watch("drift:target=IOC1,at_s=5,ppm=100000,for_s=30", seconds=80, cars=0), COMPARTMENT)

    def gaps(from_us: int, to_us: int) -> set[int]:
        inside = [t for t in fast if from_us <= t < to_us]
        return {round((later - one) / 100_000) for one, later in pairwise(inside)}

    assert gaps(8_000_000, 30_000_000) == {18}
    assert gaps(60_000_000, 80_000_000) == {20}


def test_clocks_of_several_machines_are_struck_at_once() -> None:
    seen = watch("clock_frozen:target=IOC1|MR1,at_s=5,for_s=20", seconds=30, cars=0)
    for node in (COMPARTMENT, ROBOT):
        assert [t for t in _beats_of(seen, node) if 5_500_000 < t < 25_000_000] == []


@pytest.mark.parametrize("by_ms", [-315_619_200_000, -60_000, 60_000, 2_160_000_000, 315_619_200_000])
def test_after_a_jump_of_any_size_all_take_part_again_and_the_car_comes_in(by_ms: int) -> None:
    """Whoever jumped: the time source, a follower, or both by the same."""
    for target in ("IOC1", "MR1", "IOC1|MR1"):
        seen = watch(f"clock_jump:target={target},at_s=8,by_ms={by_ms}", seconds=120)
        assert [c.holon.halted for c in seen.simulation.controllers.values()] == [None, None]
        assert seen.simulation.plant.oracle.finish() == []
        assert seen.simulation.plant.street.summary().parked == 1, target


# --- sensors and actuators -------------------------------------------------------------------------------------


def test_a_sensor_that_is_off_says_nothing() -> None:
    assert _states(watch("sensor_off:target=MR1,at_s=5,for_s=50"), 5, 55) == []
    assert _states(watch(), 5, 55) != []


def test_a_stuck_sensor_says_the_same_while_the_carrier_moves() -> None:
    positions = {state.position_mm for state in _states(watch("sensor_stuck:target=MR1,at_s=5,for_s=50"), 5, 55)}
    assert len(positions) == 1
    assert len({state.position_mm for state in _states(watch(), 5, 55)}) > 1


def test_a_flaky_sensor_loses_some() -> None:
    assert _states(watch("sensor_flaky:target=MR1,at_s=0,for_s=60,probability=1"), 1) == []


def test_a_wrong_sensor_is_off_by_what_was_asked() -> None:
    seen = watch("sensor_wrong:target=MR1,at_s=5,for_s=20,by_mm=30", seconds=20, cars=0)
    assert {state.position_mm for state in _states(seen, 5.1, 20)} == {round(_position_mm(seen)) + 30}


def test_a_stuck_actuator_stays_where_it_is() -> None:
    start_mm = _position_mm(watch(seconds=5))
    assert _position_mm(watch("actuator_stuck:target=MR1,at_s=5,for_s=100", seconds=80)) == start_mm
    assert _position_mm(watch(seconds=80)) != start_mm


def test_a_slow_drive_is_slower_than_it_was_told() -> None:
    def top(seen: Seen) -> int:
        return max(abs(state.speed_mm_s) for state in _states(seen))

    slow = watch("actuator_slow:target=MR1,at_s=5,factor=0.3", seconds=80)
    told = max(m.speed_limit_mm_s for _, m in slow.device if isinstance(m, DriveOrder))
    assert top(slow) <= round(told * 0.3) + 1
    assert top(watch(seconds=80)) > told * 0.3


def test_a_drive_can_stop_halfway() -> None:
    seen = watch("actuator_halfway:target=MR1,at_s=5,for_s=100,after_s=1", seconds=80)
    whole = watch(seconds=80)
    start_mm = _position_mm(watch(seconds=5))
    assert 0 < abs(_position_mm(seen) - start_mm) < abs(_position_mm(whole) - start_mm)


# --- people ----------------------------------------------------------------------------------------------------


def _customer(seen: Seen) -> tuple[CustomerState, VisitOutcome]:
    customer = seen.simulation.plant.street.customers[0]
    return customer.state, customer.visit.outcome


def test_who_has_lost_the_ticket_stands_at_the_desk() -> None:
    seen = watch("lost_ticket:car=1", seconds=600, leave_s=200)
    assert _customer(seen) == (CustomerState.AT_DESK, VisitOutcome.STAYING)
    assert _customer(watch(seconds=600, leave_s=200)) == (CustomerState.GONE, VisitOutcome.SERVED)


def test_the_key_can_be_pressed_again_and_again() -> None:
    seen = watch("key_presses:target=IOC1,at_s=12,times=3", seconds=20, cars=0)
    keys = {m.sequence for m in seen.desk if isinstance(m, DeskEvent) and m.event is DeskInput.KEY}
    assert len(keys) == 3


def test_a_customer_can_cancel() -> None:
    state, _ = _customer(watch("cancel:car=1,at_s=300", seconds=320))
    assert state is not CustomerState.PARKED
    assert _customer(watch(seconds=320))[0] is CustomerState.PARKED


def test_a_car_can_stay_in_the_compartment_for_long() -> None:
    seen = watch("linger:car=1,for_s=400", seconds=500, leave_s=200)
    assert _customer(seen)[0] is CustomerState.DRIVING_OUT
    assert _customer(watch(seconds=500, leave_s=200))[0] is CustomerState.GONE


def test_a_car_that_is_too_long_is_refused() -> None:
    assert _customer(watch("oversize:car=1,length_mm=7000", seconds=120)) == (
        CustomerState.GONE,
        VisitOutcome.TOO_LARGE,
    )


@pytest.mark.parametrize(
    ("also", "earliest_s", "latest_s"), [((), 35, 40), (("crash:target=MR1,at_s=33,restart_s=20",), 53, 90)]
)
def test_a_person_holds_a_machine_and_lets_it_go_once_it_can_be_asked(
    also: tuple[str, ...], earliest_s: float, latest_s: float
) -> None:
    seen = watch("held:target=MR1,at_s=20,for_s=15", *also, seconds=100)
    said = [(t / 1e6, m.manual_mode) for t, m in seen.fleet if isinstance(m, ManualState) and m.sender == ROBOT]
    held_s = [at_s for at_s, mode in said if mode is ManualMode.HELD]
    let_go_s = min(at_s for at_s, mode in said if mode is not ManualMode.HELD and at_s > held_s[0])
    assert 20 < held_s[0] < 21
    assert max(earliest_s, held_s[-1]) < let_go_s < latest_s


def test_a_door_is_forced_when_both_are_locked() -> None:
    def output(simulation: Simulation) -> DoorPosition:
        return simulation.plant.world.bays[COMPARTMENT].doors[DoorName.OUTPUT]

    fault = "door_forced:target=IOC1,at_s=0.01,door=output"
    assert watch(fault, seconds=3, cars=0, look=(0.02, output)).looks == [DoorPosition.FORCED]
    assert watch(seconds=3, cars=0, look=(0.02, output)).looks == [DoorPosition.LOCKED]


def test_a_standing_carrier_can_be_pushed_but_not_off_its_track_and_goes_back_to_its_mark() -> None:
    def positions(fault: str) -> list[int]:
        return [state.position_mm for state in _states(watch(fault, seconds=15, cars=0), from_s=5)]

    start_mm = round(_position_mm(watch(seconds=5, cars=0)))
    pushed = positions("moved:target=MR1,at_s=5,by_mm=-600")
    assert (pushed[0], pushed[-1]) == (start_mm - 600, start_mm)
    assert set(positions("moved:target=MR1,at_s=5,by_mm=9000")) == {start_mm}

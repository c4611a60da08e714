"""Machines lost for a while or for good: obstacles, whose untouched tasks pass to others (issue 4, point 3)."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from bus_sim import sites
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from onboard.config.site import parse_site
from onboard.contract.codes import CallResult, MachineState, Operation, TaskPhase
from onboard.contract.messages import Award, CallForProposals, Heartbeat, Progress, TaskReport
from onboard.core.site import Site
from tests.sites import at_arrival, at_the_key
from tests.system.scene import Scene, play, stays

#: Who wins the first task of the small site and rides ER1 (129: ER2) down to it; who else could do it.
FIRST, OTHER = 11, 12
CARS = ((0, 200), (60, 300), (120, None))


def failing(*faults: str, site: Site | None = None, cars: Sequence[tuple[float, float | None]] = CARS) -> Scene:
    """Played where the key calls, unless a site is named: the moments of the faults are meant for that."""
    injections = [parse_injection(fault) for fault in faults]
    park = site or at_the_key(find_site("small"))
    return play(park, stays(*cars), plant=lambda simulation: arm(simulation, injections), limit_s=900)


def above_the_street() -> Site:
    """The small site without places on the street's floor: every car rides."""
    text = (Path(sites.__file__).parent / "small.toml").read_text(encoding="utf-8")
    places = ", ".join(f'"p(1,{index})"' for index in range(1, 11))
    return at_the_key(
        parse_site(text.replace('sides = ["near", "far"]', f'sides = ["near", "far"]\nwithout = [{places}]'), "up")
    )


def assert_all_served(scene: Scene) -> None:
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    wanted = sum(leave is not None for _, leave in CARS)
    assert (street.parked, street.served, street.asking, street.queueing) == (len(CARS), wanted, 0, 0)


def awards(scene: Scene) -> list[tuple[int, int]]:
    """Winner and version of the awards of the first task, each once, in order."""
    whole = {(call.sender, call.call) for _, call in scene.all(CallForProposals) if call.operation is Operation.PARK}
    first = scene.first(CallForProposals)[1].task
    found = [
        (award.winner, award.task_version)
        for _, award in scene.all(Award)
        if award.task == first and award.result is CallResult.AWARDED and (award.sender, award.call) in whole
    ]
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("name", ["ER1", "ER2", "MR1", "MR2"])
def test_whoever_is_dead_from_the_start_the_rest_serves_all_that_it_can_reach(name: str) -> None:
    """ER1 and ER2 are stewards of a floor each: its segments, and the robot on it, are out of reach then."""
    for site in (at_the_key(find_site("small")), at_arrival(find_site("small"))):
        assert_all_served(failing(f"crash:target={name},at_s=5,restart=no", site=site))


def test_an_untouched_task_of_a_dead_robot_passes_to_another_by_its_custodian() -> None:
    scene = failing("crash:target=MR1,at_s=28,restart=no")
    assert_all_served(scene)
    assert awards(scene) == [(FIRST, 1), (OTHER, 2)]
    done = [report.sender for _, report in scene.all(TaskReport) if report.phase is TaskPhase.DONE]
    assert set(done) == {OTHER}


@pytest.mark.parametrize("back_s", [25, 100])
def test_a_robot_that_comes_back_late_hears_that_its_task_is_anothers(back_s: int) -> None:
    """While the other is at it, and long after it is done."""
    scene = failing(f"crash:target=MR1,at_s=28,restart_s={back_s}")
    assert_all_served(scene)
    task = scene.first(CallForProposals)[1].task
    owners = {
        report.sender for _, report in scene.all(TaskReport) if (report.task, report.phase) == (task, TaskPhase.DONE)
    }
    assert owners == {OTHER}
    assert any(r.sender == FIRST and r.phase is TaskPhase.DONE for _, r in scene.all(TaskReport)), "it works again"


def test_a_lift_that_fails_with_a_carrier_aboard_is_an_obstacle_until_it_is_repaired() -> None:
    scene = failing("crash:target=ER1,at_s=35,restart_s=100")
    assert_all_served(scene)
    assert awards(scene) == [(FIRST, 1), (OTHER, 2)]
    reports = [report for _, report in scene.all(TaskReport) if report.sender == FIRST]
    assert TaskPhase.FORFEITED in [report.phase for report in reports], "it says that it cannot come"
    left_us = min(t for t, p in scene.all(Progress) if p.sender == FIRST and p.track == 1 and p.index > 0 and t > 35e6)
    assert left_us > 135e6, "it leaves the platform after the repair"


def test_a_car_aboard_a_lift_that_fails_arrives_when_it_is_repaired_and_the_other_lift_serves_the_rest() -> None:
    scene = failing("crash:target=ER1,at_s=90,restart_s=60", site=above_the_street(), cars=((0, 300), (60, None)))
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.asking, street.queueing) == (2, 1, 0, 0)
    done = {r.task.number: (t / 1e6, r.sender) for t, r in scene.all(TaskReport) if r.phase is TaskPhase.DONE}
    assert done[1][1] == FIRST and 150 < done[1][0] < 180
    assert done[2][1] == OTHER
    assert not [r for _, r in scene.all(TaskReport) if r.phase is TaskPhase.FORFEITED and r.task.number == 1]


@pytest.mark.parametrize("for_s", [40, 3000])
def test_a_robot_whose_drive_is_stuck_stops_being_counted_on_until_it_moves(for_s: int) -> None:
    scene = failing(f"actuator_stuck:target=MR1,at_s=28,for_s={for_s}")
    assert_all_served(scene)
    assert awards(scene) == [(FIRST, 1), (OTHER, 2)]
    states = {beat.state for t, beat in scene.all(Heartbeat) if beat.sender == FIRST and 40e6 < t < 66e6}
    assert states == {MachineState.STOPPED}
    last = [beat.state for _, beat in scene.all(Heartbeat) if beat.sender == FIRST][-1]
    assert (last is MachineState.STOPPED) is (for_s == 3000)


def test_a_lift_whose_drive_is_stuck_is_gone_around() -> None:
    scene = failing("actuator_stuck:target=ER1,at_s=33,for_s=90")
    assert_all_served(scene)
    states = {beat.state for t, beat in scene.all(Heartbeat) if beat.sender == 5 and 50e6 < t < 120e6}
    assert states == {MachineState.STOPPED}


def test_who_comes_back_aboard_before_the_platform_was_given_back_rides_on() -> None:
    """Its sensors said nothing while it left the lift, so that it held the platform all the time."""
    assert_all_served(failing("sensor_off:target=MR1,at_s=40,for_s=40"))

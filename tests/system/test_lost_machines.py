"""Machines lost for a while or for good: obstacles, whose untouched tasks pass to others (issue 4, point 3)."""

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from onboard.core.codes import CallResult, Operation, TaskPhase
from onboard.core.messages import Award, CallForProposals, Progress, TaskReport
from tests.system.scene import Scene, play, stays

#: Who wins the first task of the small site and rides ER1 (129: ER2) down to it; who else could do it.
FIRST, OTHER = 11, 12
CARS = ((0, 200), (60, 300), (120, None))


def failing(*faults: str, cars: tuple[tuple[float, float | None], ...] = CARS, limit_s: float = 900) -> Scene:
    injections = [parse_injection(fault) for fault in faults]
    return play(find_site("small"), stays(*cars), plant=lambda simulation: arm(simulation, injections), limit_s=limit_s)


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
    assert_all_served(failing(f"crash:target={name},at_s=5,restart=no"))


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

"""docs/protocol.md and the DBC files are enough: a robot written from them, importing nothing of ours, parks cars."""

import ast
from functools import partial
from pathlib import Path

from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Diagnostic,
    Halted,
    Heartbeat,
    TaskReport,
    TokenDispute,
)
from onboard.systems.car_park.site import car_park
from tests.conform.foreign import joins
from tests.system.scene import play, stays

SITE = car_park(find_site("level1"))
ROBOT = SITE.machine("MR1")


def join(simulation: Simulation) -> None:
    joins(simulation)(True)


def test_it_imports_nothing_of_ours() -> None:
    for file in Path(__file__).parent.glob("*.py"):
        if file.name.startswith("test_"):
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [one for one in names if one.split(".")[0] in ("onboard", "bus_sim", "hil", "deploy")], file.name


def restarted(simulation: Simulation) -> None:
    """The compartment loses its power while the robot is on its way to the bay, and is back after five seconds."""
    join(simulation)
    bay = SITE.machine("IOC1")
    simulation.loop.call_at(95.0, partial(simulation.crash, bay))
    simulation.loop.call_at(100.0, partial(simulation.start_controller, bay))


def test_a_foreign_robot_parks_and_fetches_cars_and_bears_a_restart() -> None:
    scene = play(SITE, stays((0, 240), (60, 420)), without=frozenset({"MR1"}), before=restarted, limit_s=1_200)
    scene.assert_sound()
    done = {one.task: time_us for time_us, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE}
    awarded = [one.task for _, one in scene.all(Award) if one.result is CallResult.AWARDED]
    assert len(done) == 4 and sorted(done) == sorted(awarded), "each is awarded once, and done"
    tasks = {one.call: one.task for _, one in scene.all(CallForProposals)}
    late_us = [done[tasks[one.call]] - one.cost * 1000 for _, one in scene.all(Bid)]
    assert all(-1_000_000 < one < 2_000_000 for one in late_us), "what was bid was kept"
    digests = {one.sender: one.mirror_digest for _, one in scene.all(Heartbeat)}
    assert len(digests) == 2 and len({*digests.values()}) == 1, "both believe the same"
    assert not scene.all(Diagnostic) and not scene.all(TokenDispute) and not scene.all(Halted), "nothing was wrong"


def test_so_it_does_where_a_tenth_of_all_frames_is_lost_or_doubled() -> None:
    """Needs what no calm run does: all that is said again, and who asks where a digest is another (K3, R6)."""
    faults = [InjectedFault(kind, probability=0.1, seed=1) for kind in (FaultKind.OMISSION, FaultKind.DUPLICATE)]
    scene = play(
        SITE, stays((0, 240), (60, 420)), without=frozenset({"MR1"}), before=join, faults=faults, limit_s=1_200
    )
    scene.assert_sound()
    # By a name: what pytest prints of a whole run takes minutes.
    is_over = scene.simulation.plant.street.is_over
    assert is_over, "everybody is served"
    done = {one.task for _, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE}
    digests = {one.sender: one.mirror_digest for _, one in scene.all(Heartbeat)}
    assert len(done) == 4 and len({*digests.values()}) == 1

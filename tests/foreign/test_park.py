"""docs/protocol.md and the DBC files are enough: a robot in another language, written from them, parks cars."""

import re
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
from tests.foreign import table
from tests.foreign.life import Foreign
from tests.system.scene import play, stays

SITE = car_park(find_site("level1"))
ROBOT = SITE.machine("MR1")


def test_its_codec_is_what_the_generator_makes_of_the_dbc_files() -> None:
    assert table.FILE.read_text(encoding="utf-8") == table.text(), "python -m tests.foreign.table"


def test_it_imports_nothing_but_its_own_files_and_what_node_has() -> None:
    for file in Path(__file__).parent.glob("*.mjs"):
        found = re.findall(r'^import .* from "(.+)";$', file.read_text(encoding="utf-8"), re.M)
        assert all(re.fullmatch(r"(\./\w+\.mjs|node:(fs|readline|zlib))", one) for one in found), file.name


def restarted(simulation: Simulation, robot: Foreign) -> None:
    """The compartment loses its power while the robot is on its way to the bay, and is back after five seconds."""
    robot.join(simulation)
    bay = SITE.machine("IOC1")
    simulation.loop.call_at(95.0, partial(simulation.crash, bay))
    simulation.loop.call_at(100.0, partial(simulation.start_controller, bay))


def test_a_foreign_robot_parks_and_fetches_cars_and_bears_a_restart() -> None:
    with Foreign() as robot:
        before = partial(restarted, robot=robot)
        scene = play(SITE, stays((0, 240), (60, 420)), without=frozenset({"MR1"}), before=before, limit_s=1_200)
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
    alone = frozenset({"MR1"})
    with Foreign() as robot:
        scene = play(SITE, stays((0, 240), (60, 420)), without=alone, before=robot.join, faults=faults, limit_s=1_200)
    scene.assert_sound()
    # By a name: what pytest prints of a whole run takes minutes.
    is_over = scene.simulation.plant.street.is_over
    assert is_over, "everybody is served"
    done = {one.task for _, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE}
    digests = {one.sender: one.mirror_digest for _, one in scene.all(Heartbeat)}
    assert len(done) == 4 and len({*digests.values()}) == 1

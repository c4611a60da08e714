"""docs/protocol.md and the DBC files are enough: a robot written from them, importing nothing of ours, parks cars."""

import ast
from asyncio import TimerHandle
from functools import partial
from pathlib import Path

from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.run import FLEET
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
from onboard.core.frame import Frame
from onboard.systems.car_park.site import car_park
from tests.foreign.robot import Robot
from tests.foreign.site import Alley
from tests.system.scene import play, stays

SITE = car_park(find_site("level1"))
ROBOT = SITE.machine("MR1")
#: From one wake to the next, so that a robot that is wrong does not stop time.
AT_LEAST_US = 1_000


class Harness:
    """The foreign robot's two buses and its clock, in virtual time."""

    def __init__(self, simulation: Simulation) -> None:
        self.loop, (bay,) = simulation.loop, SITE.compartments.values()
        places = tuple(place.number for place in SITE.places)
        site = tuple(SITE.machines), SITE.digest, SITE.bitrate, SITE.stewards[1], SITE.tracks[1].length
        self.robot = Robot(Alley(ROBOT.node_id, *site, ROBOT.home.index, bay.number, places))
        self.buses = {
            FLEET: simulation.fleet.attach("foreign", ROBOT.node_id),
            "device": simulation.devices[ROBOT.node_id].attach("foreign", ROBOT.node_id),
        }
        self.timer: TimerHandle | None = None
        for name, bus in self.buses.items():
            bus.subscribe(partial(self.on_frame, name))
        self.carry_out(self.robot.start())

    def on_frame(self, name: str, frame: Frame, _: int) -> None:
        self.carry_out(self.robot.receive(name, frame.arbitration_id, frame.data, self.loop.now_us()))

    def wake(self) -> None:
        self.carry_out(self.robot.wake(self.loop.now_us()))

    def carry_out(self, frames: list[tuple[str, int, bytes]]) -> None:
        for name, number, data in frames:
            self.buses[name].send(Frame(number, data))
        if self.timer is not None:
            self.timer.cancel()
        due_us = self.robot.next_due()
        if due_us is not None:
            self.timer = self.loop.call_at(max(due_us, self.loop.now_us() + AT_LEAST_US) / 1e6, self.wake)


def join(simulation: Simulation) -> None:
    Harness(simulation)


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

"""A robot that cannot move is towed: docs/operate.md, "A robot that cannot move", word for word, on `small`."""

from functools import partial

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import MachineState, TaskPhase
from onboard.contract.messages import Award, Heartbeat, Progress, TaskReport
from onboard.operate.commands import CommandRequest, maker_of
from tests.operate.played import Played, operates
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

SITE = at_the_key(find_site("small"))
MR1, MR2 = SITE.machine("MR1").node_id, SITE.machine("MR2").node_id
#: Its drive sticks on the way to its first car, between the compartment and the lift by which it came; somebody comes
#: soon, pushes it to the end of the alley, and brings it back into service ten minutes later.
STUCK_S, HOLD_S, PUSH_S, BLOCK_S, MENDED_S, CLEAR_S, RELEASE_S = 44, 52, 62, 72, 650, 660, 680
FAULTS = (
    f"actuator_stuck:target=MR1,at_s={STUCK_S},for_s={MENDED_S - STUCK_S}",
    f"moved:target=MR1,at_s={PUSH_S},by_mm=-9000",
)
CARS = ((0, 200), (60, 300), (120, 400), (700, 800), (705, 900))


def towed() -> tuple[Scene, dict[str, Played]]:
    told: dict[str, Played] = {}

    def before(simulation: Simulation) -> None:
        give = partial(operates, simulation)
        told["hold"] = give(HOLD_S, maker_of(SITE, CommandRequest("hold", machine="MR1"), 1))
        told["block"] = give(BLOCK_S, maker_of(SITE, CommandRequest("block", segment="p(1,1)"), 1))
        told["clear"] = give(CLEAR_S, maker_of(SITE, CommandRequest("clear", segment="p(1,1)"), 1))
        told["release"] = give(RELEASE_S, maker_of(SITE, CommandRequest("release", machine="MR1"), 9))

    def plant(simulation: Simulation) -> None:
        arm(simulation, [parse_injection(fault) for fault in FAULTS])

    return play(SITE, stays(*CARS), before=before, plant=plant, limit_s=1_500), told


def test_a_robot_that_cannot_move_is_towed_and_the_other_serves_all_customers() -> None:
    scene, told = towed()
    scene.assert_sound()
    assert {name: one.status for name, one in told.items()} == {"hold": 0, "block": 0, "clear": 0, "release": 0}
    assert "MR1 has answered: it begins nothing more, and comes to rest" in told["hold"].text
    assert told["hold"].ended_us > PUSH_S * 1e6, "it could not come to rest before it was pushed to a slot"
    street = scene.simulation.plant.street.summary()
    assert (street.served, street.asking, street.queueing) == (len(CARS), 0, 0)
    done = [(t, one.sender) for t, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE]
    meanwhile = {node for t, node in done if HOLD_S * 1e6 < t < RELEASE_S * 1e6 and node in (MR1, MR2)}
    assert meanwhile == {MR2} and MR1 in {node for t, node in done if t > RELEASE_S * 1e6}
    places = {
        (one.track, one.index) for t, one in scene.all(Progress) if one.sender == MR1 and PUSH_S <= t / 1e6 < RELEASE_S
    }
    assert places == {(1, 1)}, "it stays where it was pushed"
    states = {one.state for t, one in scene.all(Heartbeat) if one.sender == MR1 and PUSH_S + 3 < t / 1e6 < RELEASE_S}
    assert states == {MachineState.OBSTACLE}
    assert not [one for t, one in scene.all(Award) if one.winner == MR1 and HOLD_S < t / 1e6 < RELEASE_S]

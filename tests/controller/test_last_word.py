"""What a controller says last on the bus agrees with what becomes of its process."""

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import Reason
from onboard.contract.messages import Halted
from onboard.operate.park import Park
from onboard.operate.words import halted_words
from onboard.ports.ending import COMES_BACK
from tests.sites import one_floor
from tests.system.scene import Scene, play, stays

ROBOT = 11
STOP_S = 60.0


def halts(scene: Scene) -> list[Halted]:
    return [one for _, one in scene.all(Halted) if one.sender == one.machine == ROBOT]


def test_a_machine_whose_disk_is_full_says_that_it_comes_back_by_itself() -> None:
    """It said that it needs a person, who was told to have its rights made anew."""

    def full(simulation: Simulation) -> None:
        arm(simulation, (parse_injection(f"disk_full:target=MR1,at_s={STOP_S},for_s=20"),))

    scene = play(one_floor(), stays((40, 150)), before=full, limit_s=600)
    (word,) = halts(scene)
    assert (word.reason, word.needs_person) == (Reason.JOURNAL_LOST, False)
    assert halted_words(Park(one_floor()), word) == "stands: journal lost; goes on by itself"
    assert scene.simulation.plant.street.summary().served == 1


@pytest.mark.parametrize("reason", [Reason.INVARIANT_BROKEN, Reason.RUNAWAY, Reason.NOT_AUTHORISED])
def test_a_halt_needs_a_person_where_its_process_waits_for_one(reason: Reason) -> None:
    def halted(simulation: Simulation) -> None:
        controller = simulation.controllers[ROBOT]
        simulation.loop.call_at(STOP_S, controller._halt, "on purpose", reason)  # as its holon would

    scene = play(one_floor(), stays((100, None)), before=halted, limit_s=70)
    (word,) = halts(scene)
    assert (word.reason, word.needs_person) == (reason, reason not in COMES_BACK)

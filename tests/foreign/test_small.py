"""The foreign robot beside ours on `small`: it does its share of 20 cars, and made faulty it does not stop the park."""

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import TaskReport
from onboard.systems.car_park.site import car_park
from tests.foreign.life import Foreign
from tests.system.scene import Scene, play, stays
from tests.thinned import some

SITE = car_park(find_site("small"))
NODE = SITE.machine("MR1").node_id
#: Each way in which it is made faulty (faults.mjs), and the rule that its own words break by it.
FAULTS = {
    "underbids": "bids-go-down",
    "deaf": "",
    "refuses": "",
    "planless": "",
    "differs": "",
    "claims": "one-holder",
    "greedy": "",
    "babbles": "",
    "dies": "",
    "unbeaten": "bids-go-down",
    "stranger": "bids-go-down",
    "fast": "",
}


def done_by(scene: Scene) -> list[int]:
    return [one.sender for _, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE]


def test_it_parks_twenty_cars_beside_ours() -> None:
    cars = tuple((90.0 * number, None) for number in range(20))
    with Foreign() as robot:
        scene = play(SITE, stays(*cars), without=frozenset({"MR1"}), before=robot.join, extra_s=90)
    scene.assert_sound()
    is_over = scene.simulation.plant.street.is_over
    assert is_over and len(done_by(scene)) == 20
    assert 5 <= done_by(scene).count(NODE) <= 15, "each has its share"


@pytest.mark.parametrize("fault", some(list(FAULTS), 4))
def test_made_faulty_it_never_stops_the_park(fault: str) -> None:
    with Foreign(fault=fault) as robot:
        demand = stays((0, None), (45, None), (90, None))
        scene = play(SITE, demand, without=frozenset({"MR1"}), before=robot.join, limit_s=900, extra_s=0)
    is_over = scene.simulation.plant.street.is_over
    assert is_over, "everybody is served"
    assert scene.simulation.plant.oracle.finish() == []
    halted = [one.holon.halted for one in scene.simulation.controllers.values() if one.holon.halted]
    assert halted == []
    broken = set(scene.verdict().counts)
    assert broken <= {FAULTS[fault]}

"""Bus time wraps on the wire, every 49.7 days in ms and every 8.9 years in us: a site that crosses it does the same."""

from functools import cache

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import Grade
from onboard.contract.messages import Award, Itinerary, TaskReport
from onboard.controller.shell import Controller
from onboard.core.bus_time import BUS_TIME_MODULUS
from onboard.core.serial import BUS_MS_MODULUS
from tests.system.scene import Scene, play, stays

#: From power-up to the wrap, s: while the first car is carried in, and while it is fetched.
WRAPS_S = (33, 228)


@cache
def undisturbed() -> list[object]:
    """The story of the same cars where nothing wraps."""
    return story(crossing(0, 0))


def crossing(modulus_us: int, after_s: float) -> Scene:
    """Two cars, one comes and goes; bus time begins so long before it wraps."""

    def early(simulation: Simulation) -> None:
        def wind(controller: Controller) -> None:
            controller.holon.clock.offset_us = modulus_us - round(after_s * 1e6)

        simulation.before_start.append(wind)

    return play(find_site("small"), stays((0, 200), (20, None)), plant=early if modulus_us else None, extra_s=60)


def story(scene: Scene) -> list[object]:
    """Who won what, which ways were planned, and what was done, by machine; frames differ in length by their bits."""
    found: list[object] = []
    for node in scene.simulation.site.machines:
        found += [one for _, one in scene.all(TaskReport) if one.sender == node]
        found += [(one.winner, one.task, one.result) for _, one in scene.all(Award) if one.sender == node]
        plans = [one for _, one in scene.all(Itinerary) if one.sender == node and one.grade is Grade.FIRM]
        found += [[leg._replace(end_ms=0) for leg in plan.legs] for plan in plans]
    return found


@pytest.mark.parametrize("modulus_us", [BUS_MS_MODULUS * 1000, BUS_TIME_MODULUS])
@pytest.mark.parametrize("after_s", WRAPS_S)
def test_a_site_that_crosses_the_wrap_does_what_it_does_else(modulus_us: int, after_s: float) -> None:
    scene = crossing(modulus_us, after_s)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 1
    assert story(scene) == undisturbed()

"""A lift's clock may show anything: nobody is sent over a sill while the platform is elsewhere."""

from collections.abc import Callable

import pytest

from bus_sim.campaign.report import RunVerdict
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.car_park.simulation import Simulation
from tests.system.scenarios import played
from tests.system.scene import play, stays
from tests.thinned import some


def wrong(*faults: str) -> Callable[[Simulation], None]:
    """``plant`` of a scene in which clocks are wrong."""
    return lambda simulation: arm(simulation, [parse_injection(fault) for fault in faults])


@pytest.mark.parametrize(
    ("ppm", "come_s"),
    some([(100_000, 200), (100_000, 300), (60_000, 300), (100_000, 500), (-100_000, 300)], 3),
)
def test_a_lift_whose_clock_is_far_ahead_takes_no_ride_for_made(ppm: int, come_s: float) -> None:
    """It believed that a ride planned for long ago was over, went for the next one, and gave its gate there."""
    plant = wrong(f"drift:at_s=20,target=ER1,ppm={ppm}", f"drift:at_s=20,target=ER2,ppm={ppm}")
    scene = play(find_site("small"), stays((come_s, None)), plant=plant, extra_s=90, limit_s=come_s + 300)
    verdict = scene.verdict()
    assert not verdict.findings, "\n".join(verdict.lines())
    assert scene.simulation.plant.oracle.finish() == []
    assert scene.simulation.plant.street.summary().parked == 1


def test_work_in_hand_goes_on_when_bus_time_jumps_by_years() -> None:
    """The deadline of its call, read in the new time, lay twelve days ahead, and the robot waited for it.

    Clocks on `small`, seed 59: a jump by nearly half the round of bus time.
    """
    jump = "clock_jump:at_s=251.214793,target=ER1|IOC1|MR1,by_ms=136391240210"
    report = played("small", 59, Arrivals(6, 120, 60, 200), jump)
    assert report.verdict is RunVerdict.SERVED, report.why()

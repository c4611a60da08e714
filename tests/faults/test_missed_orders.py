"""Actuators that miss an order: it is said again, and the customer is served (issue 4, point 3)."""

import pytest

from bus_sim.campaign.points import reference
from bus_sim.campaign.report import RunVerdict
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from tests.faults.world import watch

SITE = find_site("level1")
#: Seconds of the reference scene in which some order is lost where the actuators are deaf from there on for 8 s.
DEAF = {"IOC1": (37, 61, 133, 165, 181, 189), "MR1": (45, 69, 149, 173)}


@pytest.mark.parametrize(("name", "at_s"), [(name, at_s) for name, times in DEAF.items() for at_s in times])
def test_an_order_that_no_actuator_heard_is_said_again(name: str, at_s: int) -> None:
    fault = parse_injection(f"actuator_stuck:target={name},at_s={at_s},for_s=8")
    report = play(SITE, reference("level1", 1_200.0).with_faults([fault]))
    assert (report.verdict, report.served) == (RunVerdict.SERVED, 1), report.why()


def test_a_ticket_comes_late_and_once_where_the_desk_was_deaf() -> None:
    printed: dict[float, int] = {}
    for at_s in (40.0, 60.0, 130.0):
        seen = watch("actuator_stuck:target=IOC1,at_s=20,for_s=30", seconds=at_s)
        (compartment,) = seen.simulation.plant.compartments.values()
        printed[at_s] = len(compartment.tickets_printed)
    assert printed == {40.0: 0, 60.0: 1, 130.0: 1}

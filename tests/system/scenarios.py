"""Seeds of campaigns that once found something, played again by their faults."""

from dataclasses import replace
from pathlib import Path

from bus_sim.campaign.report import TrialReport
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from onboard.systems.car_park.site import DeskPolicy, car_park


def played(
    site: str, seed: int, arrivals: Arrivals, *faults: str, limit_s: float = 1_650, trace: Path | None = None
) -> TrialReport:
    """What came of a shipped site's seed; ``faults`` as `bus-sim run --fault` takes them.

    Cars come to the desk that reads their tickets, as on every site when these seeds were found.
    """
    scenario = FaultScenario(site, seed, limit_s, arrivals, tuple(parse_injection(fault) for fault in faults))
    park = replace(car_park(find_site(site)), desk=DeskPolicy.ANY)
    return play(park, scenario, trace=trace)

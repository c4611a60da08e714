"""Seeds of campaigns that once found something, played again by their faults."""

from pathlib import Path

from bus_sim.campaign.report import TrialReport
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals


def played(
    site: str, seed: int, arrivals: Arrivals, *faults: str, limit_s: float = 1_650, trace: Path | None = None
) -> TrialReport:
    """What came of a shipped site's seed; ``faults`` as `bus-sim run --fault` takes them."""
    scenario = FaultScenario(site, seed, limit_s, arrivals, tuple(parse_injection(fault) for fault in faults))
    return play(find_site(site), scenario, trace=trace)

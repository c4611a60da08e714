"""Seeds of faults for the tests of every system that is no car park: played and judged as a campaign does it."""

from collections.abc import Iterable
from pathlib import Path

import bus_sim
from bus_sim.campaign.profiles import draw_faults
from bus_sim.campaign.report import RunVerdict, TrialReport
from bus_sim.campaign.trial import play
from bus_sim.faults.scenario import FaultScenario
from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.trace.check.checks import Checks, LogVerdict
from onboard.trace.check.systems import rules_for

#: Plants that ship for import.
PLANTS = Path(bus_sim.__file__).parent / "data" / "plants"


def withstands(
    site: Site, seed: int, span_s: tuple[float, float], limit_s: float, profiles: tuple[str, ...] = ("bus", "crash")
) -> TrialReport:
    """Play the site's own orders under faults of the profiles, turn and turn about, begun in a span of time.

    Nothing unsafe happens, nobody halts, every order is carried out, and all mirrors are equal in the end.
    """
    faults = draw_faults(profiles[seed % len(profiles)], seed, site, span_s)
    report = play(site, FaultScenario(site.name, seed, limit_s, faults=faults))
    assert report.verdict is RunVerdict.SERVED, (report.why(), [str(fault) for fault in faults])
    assert report.halted == ()
    return report


def judged(site: Site, messages: Iterable[tuple[int, Message]]) -> LogVerdict:
    """What the rules of the site's system say to messages of its fleet bus, each with its time in us."""
    checks = Checks(site, rules=rules_for(site))
    for time_us, message in messages:
        checks.feed_message(time_us, message)
    return checks.finish()

"""Trials by their numbers: the seeds of a profile, or the points of the reference scene; failures are kept."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from bus_sim.campaign.points import SceneOccasion, reference
from bus_sim.campaign.profiles import draw_at_rate, draw_faults
from bus_sim.campaign.report import FAILURES, RunVerdict, TrialReport
from bus_sim.campaign.shared import Crash, can_share, is_shared, play_shared
from bus_sim.campaign.shrink import shrink
from bus_sim.campaign.trial import play
from bus_sim.engine import on_cores
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.faults.table import KINDS
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Coming
from onboard.core.site import Site


@dataclass(frozen=True)
class CampaignSettings:
    """What every trial of a campaign has in common. ``out``: where failures are kept; None: nowhere."""

    site: str
    profile: str
    #: None: as its system has it.
    limit_s: float | None = None
    #: What each seed brings; None: what a scenario without a word about it brings.
    demand: Coming | None = None
    out: Path | None = None
    #: The longest wait without faults, s, where it is known: of the reference scene, for single faults.
    usual_wait_s: float | None = None
    #: Faults at this rate over the whole run; None: a few in its first quarter of an hour.
    faults_an_hour: float | None = None
    #: Whether each seed is played without its faults first: a run can be called delayed only then.
    has_baseline: bool = True
    #: Of single faults, in which scene.
    scene: SceneOccasion = SceneOccasion.ALONE
    #: Of journals: how long after a machine holds a person has its rights made anew, s; 0: nobody comes.
    person_s: float = 0.0


#: Verdicts with which a run breaks off; it is played again only until so long after that, s: what follows changes no
#: verdict.
AT_ONCE, MARGIN_S = (RunVerdict.VIOLATION, RunVerdict.CRASHED), 600


class FaultPoint(NamedTuple):
    """One single fault of the reference scene, by its number."""

    number: int
    fault: AnyFault


@dataclass(frozen=True)
class TrialResult:
    """One seed or point: what came of it, and of a failure the scenario left after shrinking, and where it lies."""

    seed: int
    report: TrialReport
    shrunk: FaultScenario | None = None
    files: tuple[str, ...] = ()


def run_seed(plan: CampaignSettings, seed: int) -> TrialResult:
    """Play one seed: first without its faults, to know how long one usually waits, then with them."""
    site = find_site(plan.site)
    bare = FaultScenario(plan.site, seed, _limit_s(plan, site, seed), plan.demand)
    scenario = bare.with_faults(_faults(plan, bare, site))
    usual = play(site, bare) if plan.has_baseline or not scenario.faults else None
    if usual is not None and not scenario.faults:
        report = usual
    else:
        report = play(site, scenario, usual_wait_s=usual.longest_wait_s if usual is not None else None)
    if report.verdict not in FAILURES:
        return TrialResult(seed, report)
    least = _least(site, scenario, report)
    return TrialResult(seed, report, least, _keep(plan, site, seed, least, report))


def _least(site: Site, scenario: FaultScenario, report: TrialReport) -> FaultScenario:
    """The fewest faults that still fail. Where the run broke off, what was to come after that is left out at once."""
    if report.verdict in AT_ONCE and report.simulated_s + MARGIN_S < scenario.limit_s:
        begun = [one for one in scenario.faults if _begin_s(one) <= report.simulated_s]
        cut = replace(scenario, limit_s=math.ceil(report.simulated_s) + MARGIN_S).with_faults(begun)
        if play(site, cut).verdict is report.verdict:
            scenario = cut
    return scenario.with_faults(shrink(scenario.faults, partial(_still_fails, site, scenario, report.verdict)))


def _begin_s(fault: AnyFault) -> float:
    """When a fault begins, s; one without a moment of its own, or of single frames, was there from the beginning."""
    has_moment = isinstance(fault, Injection) and "at_s" in KINDS[fault.kind].settings
    return fault.number("at_s") if isinstance(fault, Injection) and has_moment else 0.0


def _limit_s(plan: CampaignSettings, site: Site, seed: int) -> float:
    return plan.limit_s or math.ceil(simulated_of(site).patience_s(site, plan.demand, seed))


def _faults(plan: CampaignSettings, bare: FaultScenario, site: Site) -> tuple[AnyFault, ...]:
    """A few, or at a rate as long as somebody comes or waits."""
    when = simulated_of(site).faulted(site, bare.demand, bare.seed, bare.limit_s)
    if plan.faults_an_hour is None:
        return draw_faults(plan.profile, bare.seed, site, when.span_s)
    return draw_at_rate(plan.profile, bare.seed, site, plan.faults_an_hour, when.until_s, when.arrivals_s)


def run_point(plan: CampaignSettings, point: FaultPoint) -> TrialResult:
    """Play the reference scene with one single fault, from its start."""
    scenario = _scene(plan).with_faults([point.fault])
    return _point_result(plan, point.number, play(find_site(plan.site), scenario, usual_wait_s=plan.usual_wait_s))


def run_points(plan: CampaignSettings, points: Sequence[FaultPoint], jobs: int) -> Iterator[TrialResult]:
    """The results of all points, as they come in; crashes share the beginning of their scene where this can be."""
    crashes = [Crash(number, one) for number, one in points if isinstance(one, Injection) and is_shared(one)]
    if not can_share() or len(crashes) < len(points) or len(points) < 2:
        yield from on_cores(jobs, partial(run_point, plan), points)
        return
    for number, report in play_shared(_scene(plan), crashes, plan.usual_wait_s, jobs):
        yield _point_result(plan, number, report)


def _scene(plan: CampaignSettings) -> FaultScenario:
    return reference(plan.site, plan.limit_s, plan.scene)


def _point_result(plan: CampaignSettings, number: int, report: TrialReport) -> TrialResult:
    """Of a failure its trace; there is nothing to shrink."""
    if report.verdict not in FAILURES:
        return TrialResult(number, report)
    return TrialResult(
        number, report, report.scenario, _keep(plan, find_site(plan.site), number, report.scenario, report)
    )


def _still_fails(site: Site, scenario: FaultScenario, verdict: RunVerdict, faults: Sequence[AnyFault]) -> bool:
    return play(site, scenario.with_faults(faults)).verdict is verdict


def _keep(plan: CampaignSettings, site: Site, seed: int, least: FaultScenario, report: TrialReport) -> tuple[str, ...]:
    """Write the shrunk scenario and its trace."""
    if plan.out is None:
        return ()
    plan.out.mkdir(parents=True, exist_ok=True)
    stem = f"{site.name}-{plan.profile}-{seed}"
    scenario, trace = plan.out / f"{stem}.toml", plan.out / f"{stem}.log"
    scenario.write_text(least.to_toml(f"{report.verdict.value}: {report.why()}"), encoding="utf-8")
    play(site, least, trace=trace)
    return str(scenario), str(trace)


def run_campaign(plan: CampaignSettings, seeds: Sequence[int], jobs: int) -> Iterator[TrialResult]:
    """The results of all seeds, as they come in; with one job in this process."""
    return on_cores(jobs, partial(run_seed, plan), seeds)

"""Many trials over all cores; what each brings depends on its seed alone, never on which process played it."""

import multiprocessing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from bus_sim.campaign.profiles import draw_faults
from bus_sim.campaign.shrink import shrink
from bus_sim.campaign.trial import FAILURES, Report, Verdict, play
from bus_sim.faults.injection import AnyFault
from bus_sim.faults.scenario import Arrivals, Scenario
from bus_sim.sites import find_site
from onboard.core.site import Site


@dataclass(frozen=True)
class Plan:
    """What every trial of a campaign has in common. ``out``: where failures are kept; None: nowhere."""

    site: str
    profile: str
    limit_s: float = 7_200.0
    arrivals: Arrivals = field(default_factory=Arrivals)
    out: Path | None = None


@dataclass(frozen=True)
class Result:
    """One seed: what came of it, and of a failure the scenario that is left after shrinking, and where it lies."""

    seed: int
    report: Report
    shrunk: Scenario | None = None
    files: tuple[str, ...] = ()


def run_seed(plan: Plan, seed: int) -> Result:
    """Play one seed: first without its faults, to know how long one usually waits, then with them."""
    site = find_site(plan.site)
    bare = Scenario(plan.site, seed, plan.limit_s, plan.arrivals)
    usual = play(site, bare)
    scenario = bare.with_faults(draw_faults(plan.profile, seed, site))
    report = play(site, scenario, usual_wait_s=usual.longest_wait_s) if scenario.faults else usual
    if report.verdict not in FAILURES:
        return Result(seed, report)
    least = scenario.with_faults(shrink(scenario.faults, partial(_still_fails, site, scenario, report.verdict)))
    return Result(seed, report, least, _keep(plan, site, seed, least, report))


def _still_fails(site: Site, scenario: Scenario, verdict: Verdict, faults: Sequence[AnyFault]) -> bool:
    return play(site, scenario.with_faults(faults)).verdict is verdict


def _keep(plan: Plan, site: Site, seed: int, least: Scenario, report: Report) -> tuple[str, ...]:
    """Write the shrunk scenario and its trace."""
    if plan.out is None:
        return ()
    plan.out.mkdir(parents=True, exist_ok=True)
    stem = f"{site.name}-{plan.profile}-{seed}"
    scenario, trace = plan.out / f"{stem}.toml", plan.out / f"{stem}.log"
    scenario.write_text(least.to_toml(f"{report.verdict.value}: {report.why()}"), encoding="utf-8")
    play(site, least, trace=trace)
    return str(scenario), str(trace)


def run_campaign(plan: Plan, seeds: Sequence[int], jobs: int) -> Iterator[Result]:
    """The results of all seeds, as they come in; with one job in this process."""
    if jobs <= 1:
        for seed in seeds:
            yield run_seed(plan, seed)
        return
    # A fresh interpreter each: nothing that this process has done can reach a trial.
    with multiprocessing.get_context("spawn").Pool(min(jobs, len(seeds))) as pool:
        yield from pool.imap_unordered(partial(run_seed, plan), seeds)

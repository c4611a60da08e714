"""``bus-sim campaign``: the command line, the progress bar, and the exit status."""

import argparse
import json
import os
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bus_sim.campaign import table
from bus_sim.campaign.profiles import PROFILES
from bus_sim.campaign.runner import Plan, Result, run_campaign
from bus_sim.campaign.trial import FAILURES, Verdict, play
from bus_sim.demand import DemandError
from bus_sim.faults.scenario import Arrivals, load_scenario
from bus_sim.sites import find_site

HELP = """\
Each seed brings its own customers and its own faults, drawn from the profile. A run with a failure is shrunk to the
fewest faults that still fail; its scenario (bus-sim run --scenario FILE) and its trace are kept.

exit status:
  0  safety held in every run
  1  an invariant of the plant was broken, or a program failed
  2  a mistake in the command line
"""


def add_campaign(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """The subcommand."""
    parser = commands.add_parser(
        "campaign",
        help="run a site under many seeds of faults",
        description=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("site", help="name of a shipped site, or a site file")
    parser.add_argument("--seeds", default="1-16", metavar="A-B", help="from the first to the last (default: 1-16)")
    parser.add_argument("--faults", default="all", metavar="PROFILE", help=f"{', '.join(PROFILES)} (default: all)")
    parser.add_argument("--jobs", type=int, default=0, metavar="N", help="processes (default: one a core)")
    parser.add_argument("--cars", type=int, default=6, metavar="N", help="cars in each run (default: 6)")
    parser.add_argument("--limit", type=float, default=7200.0, metavar="SECONDS", help="longest run (default: 7200)")
    parser.add_argument(
        "--out", type=Path, default=Path("campaign"), metavar="DIR", help="failures (default: campaign)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results as JSON too")


def run_campaign_command(args: argparse.Namespace) -> int:
    """Play it. Raises ``DemandError`` for a mistake in the command line, ``SiteNotFoundError`` for an unknown site."""
    site = find_site(args.site)
    plan, seeds = _plan(args), _seeds(args.seeds)
    jobs = args.jobs or os.cpu_count() or 1
    console = Console()
    console.print(
        f"campaign on {site.name}: seeds {seeds[0]}-{seeds[-1]}, faults {plan.profile}, {plan.arrivals.cars} cars each",
        highlight=False,
    )
    results: list[Result] = []
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("runs", total=len(seeds))
        for result in run_campaign(plan, seeds, jobs):
            results.append(result)
            progress.advance(task)
    results.sort(key=lambda result: result.seed)
    for line in table.lines(results):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if args.json is not None:
        args.json.write_text(json.dumps(table.to_json(plan, results), indent=2) + "\n", encoding="utf-8")
    bad = (Verdict.VIOLATION, Verdict.CRASHED)
    return 1 if any(result.report.verdict in bad for result in results) else 0


def _plan(args: argparse.Namespace) -> Plan:
    if args.faults not in PROFILES:
        raise DemandError(f"--faults {args.faults}: no such profile; profiles are {', '.join(PROFILES)}")
    if args.jobs < 0:
        raise DemandError(f"--jobs {args.jobs}: must be 1 or more; leave it out for one a core")
    if args.cars < 1:
        raise DemandError(f"--cars {args.cars}: must be 1 or more")
    if not args.limit > 0:
        raise DemandError(f"--limit {args.limit}: must be above 0")
    return Plan(args.site, args.faults, args.limit, Arrivals(cars=args.cars), args.out)


def _seeds(text: str) -> range:
    first, dash, last = text.partition("-")
    if not first.isdecimal() or (dash and not last.isdecimal()) or int(last or first) < int(first):
        raise DemandError(f"--seeds {text}: must be a seed, or the first and the last of several, such as 1-16")
    return range(int(first), int(last or first) + 1)


def run_scenario(path: Path, trace: Path | None, json_file: Path | None) -> int:
    """Play one scenario file as a campaign plays it, and tell what came of it; 0 where everybody was served or told.

    Raises ``ConfigError`` with one line for each mistake in the file.
    """
    scenario, site = load_scenario(path)
    console = Console()
    console.print(
        f"scenario {path.name}: site {site.name}, {scenario.arrivals.cars} cars, seed {scenario.seed}, "
        f"{len(scenario.faults)} faults",
        highlight=False,
        soft_wrap=True,
    )
    for fault in scenario.faults:
        console.print(f"fault        {fault}", highlight=False, markup=False, soft_wrap=True)
    report = play(site, scenario, trace=trace)
    told = [
        f"outcome      {report.verdict.value}",
        f"customers    served {report.served}   told why {report.told}   waiting {report.waiting}   "
        f"longest wait {report.longest_wait_s:.0f} s   in {report.simulated_s:.0f} s",
        *(f"HALTED       {line}" for line in report.halted),
        *(f"VIOLATION    {line}" for line in report.violations),
        *([f"ERROR        {report.error}"] if report.error else []),
        *([f"trace        {trace}"] if trace is not None else []),
    ]
    for line in told:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if json_file is not None:
        result = Result(scenario.seed, report)
        text = json.dumps(table.to_json(Plan(scenario.site, "scenario"), [result]), indent=2)
        json_file.write_text(text + "\n", encoding="utf-8")
    return 1 if report.verdict in FAILURES else 0

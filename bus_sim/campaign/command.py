"""``bus-sim campaign``: the command line, the progress bar, and the exit status."""

import argparse
import json
import os
import random
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from rich.console import Console

from bus_sim.campaign import table
from bus_sim.campaign.cold_start import cold_starts
from bus_sim.campaign.ledger import Ledger, site_as_played
from bus_sim.campaign.points import SceneOccasion, Single, count, points, reference
from bus_sim.campaign.profiles import PROFILES, kinds_for, profile_names
from bus_sim.campaign.report import FAILURES, RunVerdict
from bus_sim.campaign.runner import CampaignSettings, FaultPoint, TrialResult, run_point, run_points, run_seed
from bus_sim.campaign.strangers import StrangerPlan, play_pairs
from bus_sim.campaign.trial import play
from bus_sim.demand import LONGEST_S, MOST_CARS, MOST_ORDERS, DemandError, check_count, read_seeds
from bus_sim.engine import add_where_options, engine_of, shown
from bus_sim.faults.scenario import load_scenario
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stranger import Stranger
from bus_sim.systems.system import Occasion
from onboard.core.site import Site

#: One fault a second: more is no fleet under faults, but a fleet that is off.
MOST_AN_HOUR = 3_600

HELP = """\
Each seed brings its own customers to a car park, or its own orders to any other site, and its own faults, drawn from
the profile. A run with a failure is shrunk to the fewest faults that still fail; its scenario (bus-sim run --scenario
FILE) and its trace are kept. Every run is judged by the plant's oracle and by the checkers of `onboard trace check`:
safety at any time, and when all faults are over also that everything goes on, that everybody is served or told why,
and that all mirrors become equal.

With --exhaustive one reference scene (a car in and out, or one order; with --scene overlap three that meet) is
played again and again, each time with one single fault: every frame lost or doubled at each receiver, or every
controller killed before each of its frames and around each of its journal writes, or (journal) at each of its writes
with the write torn, 1 to 50 records lost, a page zeroed, a bit flipped, the seal gone, another machine's journal, an
old copy, or no journal at all. A machine that holds because it cannot rely on its journal, and says so, counts as told.

exit status:
  0  every run was safe, and went on once its faults were over
  1  some run was not: the table says how, and the files that are named hold its scenario and its trace
  2  a mistake in the command line

examples:
  bus-sim campaign small --seeds 1-100 --faults crash
  bus-sim campaign standard --seeds 1-8 --cars 300 --apart 90 --faults-an-hour 6 --no-baseline --limit 86400
  bus-sim campaign graph --seeds 1-30 --orders 40
  bus-sim campaign small --exhaustive crash --sample 400
  bus-sim campaign small --exhaustive journal --sample 400
  bus-sim campaign small --exhaustive crash --scene overlap --add-to crashes.jsonl
  bus-sim campaign small --seeds 1-2000 --faults two-crashes --apart 30 --no-baseline --add-to crashes.jsonl
  bus-sim campaign standard --cold-start
  bus-sim campaign large --cold-start --sample 12
  bus-sim campaign standard --seeds 1-2000 --dask tcp://10.0.0.5:8786
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of ``campaign``, and its description."""
    parser.description, parser.formatter_class = HELP, argparse.RawDescriptionHelpFormatter
    parser.add_argument("site", help="name of a shipped site, or a site file")
    parser.add_argument("--seeds", default="1-16", metavar="A-B", help="from the first to the last (default: 1-16)")
    parser.add_argument(
        "--faults",
        default="all",
        metavar="PROFILE",
        help=f"{', '.join(PROFILES)}, or several of them with commas between (default: all)",
    )
    parser.add_argument(
        "--exhaustive", choices=[str(one) for one in Single], help="every single fault of a kind in one reference scene"
    )
    parser.add_argument(
        "--scene",
        choices=[str(one) for one in SceneOccasion],
        default=str(SceneOccasion.ALONE),
        help="with --exhaustive: one car alone, or three that overlap (default: alone)",
    )
    parser.add_argument(
        "--cold-start",
        action="store_true",
        help="instead of seeds: cut the power of all machines at work, and see who takes part again within 30 s, with "
        "nobody missing and with each machine missing in turn",
    )
    parser.add_argument(
        "--sample", type=int, metavar="N", help="with --exhaustive or --cold-start: only so many, spread over all"
    )
    parser.add_argument(
        "--person",
        type=float,
        metavar="S",
        help="with --exhaustive journal: so many seconds after a machine holds for its journal somebody has its rights "
        "made anew, and the first who waits must be served within 5 minutes (default: nobody comes)",
    )
    add_where_options(parser)
    parser.add_argument("--cars", type=int, metavar="N", help="cars in each run of a car park (default: a few)")
    parser.add_argument(
        "--orders",
        type=int,
        metavar="N",
        help="orders in each run of any other site; 0 for those of the site file (default: a few, by the system)",
    )
    parser.add_argument(
        "--apart",
        type=float,
        metavar="SECONDS",
        help="mean time between two cars, or orders (default: by the system)",
    )
    parser.add_argument(
        "--faults-an-hour",
        type=float,
        metavar="N",
        help="so many faults in the mean, over the whole run (default: 1 to 4, in the first 900 s of a car park's run)",
    )
    parser.add_argument(
        "--no-baseline",
        action="store_true",
        help="do not play each seed without its faults first: twice as fast, and no run is called delayed",
    )
    parser.add_argument(
        "--limit",
        type=float,
        metavar="SECONDS",
        help="longest run (default: two hours on a car park, else by the orders)",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("campaign"), metavar="DIR", help="failures (default: campaign)"
    )
    parser.add_argument(
        "--stranger",
        choices=[one.value for one in Stranger],
        help="no faults: the first machine that works bids and does not do what it wins, beside the same seeds "
        "without it",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results as JSON too")
    parser.add_argument(
        "--add-to",
        type=Path,
        metavar="FILE",
        help="add each result to this file, and leave out what it has of the same state of the program",
    )


def run(args: argparse.Namespace) -> int:
    """Play it. Raises ``DemandError`` for a mistake in the command line, ``SiteNotFoundError`` for an unknown site."""
    site = find_site(args.site)
    plan = _plan(args, site)
    if args.stranger is not None:
        return _strangers(args, plan, site)
    console = Console()
    if args.cold_start:
        return _start_cold(args, site, console)
    ledger = _ledger(args, plan)
    trials, total = _trials(args, plan, site, console, ledger)
    results: list[TrialResult] = []
    for result in shown(trials, total, "runs", console):
        results.append(result)
        if ledger is not None:
            ledger.add(result.seed, result.report.verdict, _why(result))
    results.sort(key=lambda result: result.seed)
    for line in table.lines(results):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if args.json is not None:
        args.json.write_text(json.dumps(table.to_json(plan, results), indent=2) + "\n", encoding="utf-8")
    if ledger is not None:
        for line in ledger.lines():
            console.print(line, highlight=False, markup=False, soft_wrap=True)
    has_failed = any(result.report.verdict in FAILURES for result in results)
    return 1 if has_failed or (ledger is not None and ledger.has_failed) else 0


def _strangers(args: argparse.Namespace, plan: CampaignSettings, site: Site) -> int:
    system, seeds = simulated_of(site), read_seeds(args.seeds)
    if system.worker is None:
        raise DemandError(
            f"--stranger {args.stranger}: {site.name} is a {site.called}, where no machine bids by the calls of all"
        )
    if sum(machine.kind is system.worker for machine in site.machines.values()) < 2:
        raise DemandError(
            f"--stranger {args.stranger}: {site.name} has one {system.worker.name.lower()}, and nobody else could do "
            "what that wins; take a site with two"
        )
    limit_s = plan.limit_s or system.patience_s(site, plan.demand, seeds[0])
    strange = StrangerPlan(args.site, Stranger(args.stranger), plan.demand, limit_s)
    pairs = sorted(play_pairs(strange, seeds, args.jobs or os.cpu_count() or 1), key=lambda one: one.seed)
    for pair in pairs:
        print(pair.line())
    bad = [pair for pair in pairs if not pair.is_good]
    worst = max(pair.longer_s for pair in pairs)
    told = f"{len(pairs)} {'seed' if len(pairs) == 1 else 'seeds'} with a machine that {strange.how.does}"
    print(f"{told}: {len(bad)} failed; mean wait at most {worst:.1f} s longer than without it")
    return 1 if bad else 0


def _start_cold(args: argparse.Namespace, site: Site, console: Console) -> int:
    """0 where every machine with power took part in time, each time."""
    starts = []
    for start in cold_starts(site, args.site, sample=args.sample):
        console.print(str(start), highlight=False, markup=False, soft_wrap=True)
        starts.append(start)
    longest_s = max(start.longest_s for start in starts)
    bad = sum(not start.is_good for start in starts)
    console.print(f"{len(starts)} starts, {bad} failed; at most {longest_s:.1f} s", highlight=False)
    return 1 if bad else 0


def _why(result: TrialResult) -> str:
    """Of a failure, why and with which faults."""
    if result.report.verdict not in FAILURES:
        return ""
    least = result.shrunk or result.report.scenario
    return "; ".join([result.report.why(), *(str(fault) for fault in least.faults)])


def _ledger(args: argparse.Namespace, plan: CampaignSettings) -> Ledger[RunVerdict] | None:
    """The results so far, where there is a file for them; it knows a campaign by all that its trials have in common."""
    if args.add_to is None:
        return None
    what = [
        site_as_played(plan.site),
        plan.profile,
        str(plan.scene),
        str(plan.demand),
        f"{plan.faults_an_hour}",
        f"{plan.limit_s}",
        *([f"a person after {plan.person_s:g} s"] if plan.person_s else []),
    ]
    return Ledger.read(args.add_to, "; ".join(what), RunVerdict, FAILURES)


def _trials(
    args: argparse.Namespace, plan: CampaignSettings, site: Site, console: Console, ledger: Ledger[RunVerdict] | None
) -> tuple[Iterator[TrialResult], int]:
    """What is to be played, as an iterator over results, and how many they will be."""
    play_all = engine_of(args)
    if args.exhaustive is None:
        seeds = read_seeds(args.seeds)
        head = f"campaign on {site.name}: seeds {seeds[0]}-{seeds[-1]}, faults {plan.profile}"
        console.print(f"{head}, {simulated_of(site).count(plan.demand)} each", highlight=False)
        left = seeds if ledger is None else ledger.open_of(seeds)
        return play_all(partial(run_seed, plan), left), len(left)
    counts = count(site, reference(plan.site, plan.limit_s, plan.scene))
    plan = replace(plan, usual_wait_s=counts.longest_wait_s)
    every = [
        FaultPoint(number, one)
        for number, one in enumerate(points(site, Single(args.exhaustive), counts, plan.person_s), start=1)
    ]
    chosen = every if args.sample is None else random.Random(0).sample(every, min(args.sample, len(every)))
    several = f"{args.exhaustive}es" if args.exhaustive.endswith("sh") else f"{args.exhaustive}s"
    console.print(f"{several} on {site.name}: {len(chosen)} of {len(every)} points", highlight=False)
    chosen = chosen if ledger is None else [one for one in chosen if one.number not in ledger.done]
    if args.dask:
        return play_all(partial(run_point, plan), chosen), len(chosen)
    return run_points(plan, chosen, args.jobs or os.cpu_count() or 1), len(chosen)


def _plan(args: argparse.Namespace, site: Site) -> CampaignSettings:
    """A plan, of which the first seed's customers or orders have been drawn once to see that they can be."""
    _check(args)
    system = simulated_of(site)
    if args.exhaustive is not None:
        scene = SceneOccasion(args.scene)
        demand = system.on(Occasion(scene), site)
        limit_s = args.limit or system.patience_s(site, demand, 1)
        person_s = args.person or 0.0
        return CampaignSettings(
            args.site, args.exhaustive, limit_s, demand, out=args.out, scene=scene, person_s=person_s
        )
    if args.faults != "none" and not kinds_for(args.faults, site):
        raise DemandError(f"--faults {args.faults}: {site.name} is a {site.called}, which has none of these")
    demand = system.usual(site, {"cars": args.cars, "orders": args.orders, "apart": args.apart})
    system.check(site, demand, read_seeds(args.seeds)[0])
    return CampaignSettings(
        args.site,
        args.faults,
        args.limit,
        demand,
        out=args.out,
        faults_an_hour=args.faults_an_hour,
        has_baseline=not args.no_baseline,
    )


def _check(args: argparse.Namespace) -> None:
    """Raise ``DemandError`` for the first value that no site takes."""
    profile_names(args.faults)
    if args.cars is not None and not 1 <= args.cars <= MOST_CARS:
        raise DemandError(f"--cars {args.cars}: must be from 1 to {MOST_CARS}")
    if args.orders is not None:
        check_count("--orders", args.orders, MOST_ORDERS)
    _check_seconds("apart", args.apart)
    _check_seconds("limit", args.limit)
    if args.faults_an_hour is not None and not 0 < args.faults_an_hour <= MOST_AN_HOUR:
        raise DemandError(f"--faults-an-hour {args.faults_an_hour:g}: must be above 0, and at most {MOST_AN_HOUR}")
    _check_seconds("person", args.person)
    if args.person is not None and args.exhaustive != str(Single.JOURNAL):
        raise DemandError(f"--person {args.person:g}: goes with --exhaustive journal; add it, or leave this out")
    if args.scene != str(SceneOccasion.ALONE) and args.exhaustive is None:
        raise DemandError(f"--scene {args.scene}: goes with --exhaustive; add it, or leave this out")
    if args.sample is not None and (args.sample < 1 or (args.exhaustive is None and not args.cold_start)):
        raise DemandError(f"--sample {args.sample}: must be 1 or more, and goes with --exhaustive or --cold-start")


def _check_seconds(option: str, value: float | None) -> None:
    if value is not None and not 0 < value <= LONGEST_S:
        raise DemandError(f"--{option} {value:g}: must be above 0, and at most {LONGEST_S} seconds")


def run_scenario(path: Path, trace: Path | None, json_file: Path | None, *, devices: bool = False) -> int:
    """Play one scenario file as a campaign plays it, and tell what came of it; 0 where everybody was served or told.

    ``devices``: the trace has the device buses too.

    Raises ``ConfigError`` with one line for each mistake in the file.
    """
    scenario, site = load_scenario(path)
    console = Console()
    console.print(
        f"scenario {path.name}: site {site.name}, {simulated_of(site).count(scenario.demand)}, "
        f"seed {scenario.seed}, {len(scenario.faults)} faults",
        highlight=False,
        soft_wrap=True,
    )
    for fault in scenario.faults:
        console.print(f"fault        {fault}", highlight=False, markup=False, soft_wrap=True)
    report = play(site, scenario, trace=trace, devices=devices)
    told = [
        f"outcome      {report.verdict.value}",
        f"{table.who([report]):<13}served {report.served}   told why {report.told}   waiting {report.waiting}   "
        f"longest wait {report.longest_wait_s:.0f} s   in {report.simulated_s:.0f} s",
        *(f"HALTED       {line}" for line in report.halted),
        *(f"VIOLATION    {line}" for line in report.violations),
        *(f"STOOD STILL  {line}" for line in report.stalls),
        *([f"ERROR        {report.error}"] if report.error else []),
        *([f"trace        {trace}"] if trace is not None else []),
    ]
    for line in told:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if json_file is not None:
        result = TrialResult(scenario.seed, report)
        text = json.dumps(table.to_json(CampaignSettings(scenario.site, "scenario"), [result]), indent=2)
        json_file.write_text(text + "\n", encoding="utf-8")
    return 1 if report.verdict in FAILURES else 0

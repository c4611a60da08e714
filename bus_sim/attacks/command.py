"""``bus-sim attack``: the command line, the table and the exit status."""

import argparse
import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.trials import AttackResult, TrialSettings, run_attacks
from bus_sim.campaign.command import read_seeds
from bus_sim.campaign.report import RunVerdict
from bus_sim.demand import DemandError
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from onboard.config.problems import nearest

#: In the order of the table's columns.
_COLUMNS = (*(verdict for verdict in reversed(RunVerdict)),)

HELP = """\
Each attack is played by a node that sees only the bus, under each seed, on a site that runs its usual orders; it is
judged by the plant's oracle, by the checkers of `onboard trace check`, and by what became of everybody who came.

exit status:
  0  every attack was harmless: nothing happened to any body, nobody stands for good, everybody was served or told why
  1  some attack was not; the table says which
  2  a mistake in the command line

examples:
  bus-sim attack small --seeds 1-20
  bus-sim attack terminal --attacks grant-refused,claim --seeds 1-3
  bus-sim run small --cars 5 --random 40 15 --fault attack:name=stop,at_s=60,for_s=20

attacks:
"""


def add_attack(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add ``attack`` to the commands of ``bus-sim``, with its options."""
    parser = commands.add_parser(
        "attack",
        help="attack a site by a node that sees only the bus",
        description=HELP + "\n".join(f"  {name:<14} {entry.summary}" for name, entry in ATTACKS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("site", help="name of a shipped site, or a site file")
    parser.add_argument("--attacks", metavar="A,B", help="only these (default: all)")
    parser.add_argument("--seeds", default="1-3", metavar="A-B", help="from the first to the last (default: 1-3)")
    parser.add_argument(
        "--node",
        type=int,
        default=240,
        metavar="N",
        help="the attacker's node-ID (default: 240); one of the site's where it requires seals",
    )
    parser.add_argument("--cars", type=int, metavar="N", help="to a car park (default: a few)")
    parser.add_argument("--orders", type=int, metavar="N", help="to any other site (default: a few, by the system)")
    parser.add_argument("--limit", type=float, metavar="SECONDS", help="longest run (default: by the orders)")
    parser.add_argument("--jobs", type=int, default=0, metavar="N", help="processes (default: one a core)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results as JSON too")


def run_attack_command(args: argparse.Namespace) -> int:
    """Play them. Raises ``DemandError`` for a mistake in the command line, ``SiteNotFoundError`` for no such site."""
    plan, attacks, seeds = _plan(args), _attacks(args.attacks), read_seeds(args.seeds)
    console, results = Console(), list[AttackResult]()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("attacks", total=len(attacks) * len(seeds))
        for result in run_attacks(plan, attacks, seeds, args.jobs or os.cpu_count() or 1):
            results.append(result)
            progress.advance(task)
    results.sort(key=lambda result: (attacks.index(result.attack), result.seed))
    for line in table(args.site, attacks, results):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if args.json is not None:
        args.json.write_text(json.dumps(to_json(plan, results), indent=2) + "\n", encoding="utf-8")
    return 0 if all(result.is_harmless for result in results) else 1


def _plan(args: argparse.Namespace) -> TrialSettings:
    site = find_site(args.site)
    if not 1 <= args.node <= 255:
        raise DemandError(f"--node {args.node}: must be from 1 to 255")
    if args.node in site.machines and site.seals != "required":
        name = site.machines[args.node].name
        remedy = 'give a number that no machine there has, or a site with seals = "required"'
        raise DemandError(f"--node {args.node}: that is {name} of {site.name}; {remedy}")
    for option, value in (("cars", args.cars), ("limit", args.limit)):
        if value is not None and value <= 0:
            raise DemandError(f"--{option} {value:g}: must be above 0")
    if args.jobs < 0:
        raise DemandError(f"--jobs {args.jobs}: must be 1 or more; leave it out for one a core")
    system = simulated_of(site)
    demand = system.on(Occasion.ATTACK, site)
    if args.cars is not None or args.orders is not None:
        demand = system.usual(site, {"cars": args.cars, "orders": args.orders, "apart": demand.apart_s})
    return TrialSettings(args.site, args.node, args.limit, demand)


def _attacks(text: str | None) -> list[str]:
    if text is None:
        return list(ATTACKS)
    named = text.split(",")
    for name in named:
        if name not in ATTACKS:
            raise DemandError(f"--attacks {name}: no such attack; {nearest(name, list(ATTACKS))}")
    return list(dict.fromkeys(named))


def table(site: str, attacks: Sequence[str], results: Sequence[AttackResult]) -> list[str]:
    """A row for each attack, then a line for each run that was not harmless."""
    came = Counter((result.attack, result.report.verdict) for result in results)
    used = [column for column in _COLUMNS if any(verdict is column for _, verdict in came)]
    lines = [f"{'attacks on ' + site:<24}{'harmless':>10}" + "".join(f"{column.value:>16}" for column in used)]
    for attack in attacks:
        mine = [result for result in results if result.attack == attack]
        harmless = f"{sum(result.is_harmless for result in mine)}/{len(mine)}"
        lines.append(f"{attack:<24}{harmless:>10}" + "".join(f"{came[attack, column] or '.':>16}" for column in used))
    return lines + [
        f"{result.attack}, seed {result.seed}: {result.report.verdict.value}: {result.why()}"
        for result in results
        if not result.is_harmless
    ]


def to_json(plan: TrialSettings, results: Sequence[AttackResult]) -> dict[str, object]:
    """The plan and one entry a run, as ``json.dump`` takes them; units stand in the keys."""
    return {
        "site": plan.site,
        "node": plan.node,
        "runs": [
            {
                "attack": result.attack,
                "seed": result.seed,
                "harmless": result.is_harmless,
                "verdict": result.report.verdict.value,
                "served": result.report.served,
                "told": result.report.told,
                "waiting": result.report.waiting,
                "longest_wait_s": result.report.longest_wait_s,
                "violations": list(result.report.violations),
                "halted": list(result.report.halted),
                "error": result.report.error,
            }
            for result in results
        ],
    }

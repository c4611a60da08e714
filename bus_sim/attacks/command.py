"""``bus-sim attack``: the command line, the table and the exit status."""

import argparse
import json
import os
import re
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bus_sim.attacks import table
from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.trials import MISSES, STRANGER, AttackResult, AttackVerdict, TrialSettings, run_attacks
from bus_sim.campaign.ledger import Ledger, site_as_played
from bus_sim.demand import LONGEST_S, MOST_CARS, MOST_ORDERS, DemandError, check_count, read_seeds
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from onboard.config.problems import nearest
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Site

HELP = """\
Each attack is played by a node that sees only the bus, under each seed, on a site that runs its usual orders; it is
judged by the plant's oracle, by the checkers of `onboard trace check`, and by what became of everybody who came.

It is harmless where nothing happened to any body, nobody stands for good, and everybody was served or told why. Beside
it stands whether service was back within 60 s of its end (all take part, and work or have nothing to do), and whether a
machine named it on the bus with a right word within two heartbeats (of a flood: once the bus has room).

The attacker speaks under node-ID 240, or the next that no machine has; where the site requires seals, under one of the
site's own, drawn for each attack and seed. Attacks under the numbers of several machines are left out where the site
has no seals: there they are believed. --insider gives it the keys of its machine as well (docs/security.md says what it
can do).

exit status:
  0  every attack was harmless, named in time, and service was back in time
  1  some attack was not; the table says which
  2  a mistake in the command line

examples:
  bus-sim attack small --seeds 1-20
  bus-sim attack terminal --attacks grant-refused,claim --seeds 1-3
  bus-sim attack small --cars 3 --seeds 1-10 --jobs 8 --add-to attacks.jsonl
  bus-sim attack cell --begin 0.05-6
  bus-sim run small --cars 5 --random 40 15 --fault attack:name=stop,at_s=60,for_s=20

attacks:
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of ``attack``, and its description, which lists them all."""
    parser.description = HELP + "\n".join(f"  {name:<17} {entry.summary}" for name, entry in ATTACKS.items())
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("site", help="name of a shipped site, or a site file")
    parser.add_argument("--attacks", metavar="A,B", help="only these (default: all)")
    parser.add_argument("--seeds", default="1-3", metavar="A-B", help="from the first to the last (default: 1-3)")
    parser.add_argument(
        "--node",
        type=int,
        metavar="N",
        help=f"the attacker's node-ID (default: {STRANGER} or the next free; with seals required one of the site's)",
    )
    parser.add_argument(
        "--insider",
        action="store_true",
        help="the attacker has the keys of that node, which is one of the site's machines, or a tool",
    )
    parser.add_argument("--cars", type=int, metavar="N", help="to a car park (default: a few)")
    parser.add_argument("--orders", type=int, metavar="N", help="to any other site (default: a few, by the system)")
    parser.add_argument("--limit", type=float, metavar="SECONDS", help="longest run (default: by the orders)")
    parser.add_argument(
        "--begin", metavar="A-B", help="it begins from A to B s after power-up (default: while orders are carried out)"
    )
    parser.add_argument("--jobs", type=int, default=0, metavar="N", help="processes (default: one a core)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results as JSON too")
    parser.add_argument(
        "--add-to",
        type=Path,
        metavar="FILE",
        help="add each result to this file, leave out what it has of the same state of the program, and show all of it",
    )


def run(args: argparse.Namespace) -> int:
    """Play them. Raises ``DemandError`` for a mistake in the command line, ``SiteNotFoundError`` for no such site."""
    site = find_site(args.site)
    plan, attacks, seeds = _plan(args, site), _attacks(args, site), read_seeds(args.seeds)
    ledger = _ledger(args, plan)
    done = [] if ledger is None else [AttackResult.from_json(entry.more["result"]) for entry in ledger.done.values()]
    known = {(result.attack, result.seed) for result in done}
    left = [(attack, seed) for seed in seeds for attack in attacks if (attack, seed) not in known]
    console, results = Console(), done
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("attacks", total=len(left))
        for result in run_attacks(plan, left, args.jobs or os.cpu_count() or 1):
            results.append(result)
            if ledger is not None:
                name = f"{result.attack} {result.seed}"
                ledger.add(name, result.verdict, result.why, {"result": result.to_json()})
            progress.advance(task)
    results.sort(key=lambda result: (list(ATTACKS).index(result.attack), result.seed))
    head = f"attacks on {site.name}" + (" by an insider" if plan.is_insider else "")
    for line in table.lines(head, list(ATTACKS), results):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if args.json is not None:
        args.json.write_text(json.dumps(table.to_json(plan, results), indent=2) + "\n", encoding="utf-8")
    return 1 if any(result.verdict in MISSES for result in results) else 0


def _ledger(args: argparse.Namespace, plan: TrialSettings) -> Ledger[AttackVerdict] | None:
    """The results so far, where there is a file for them."""
    if args.add_to is None:
        return None
    who = f"insider {plan.node}" if plan.is_insider else f"node {plan.node}"
    what = ["attack", site_as_played(plan.site), who, str(plan.demand), f"{plan.limit_s}"]
    what += [] if plan.begin_s is None else [f"begins {plan.begin_s}"]
    return Ledger.read(args.add_to, "; ".join(what), AttackVerdict, MISSES)


def _plan(args: argparse.Namespace, site: Site) -> TrialSettings:
    is_of_site = args.node in site.machines
    if args.node is not None and not 1 <= args.node <= 255:
        raise DemandError(f"--node {args.node}: must be from 1 to 255")
    if is_of_site and site.seals != "required" and not args.insider:
        name = site.machines[args.node].name
        remedy = 'give a number that no machine there has, a site with seals = "required", or --insider'
        raise DemandError(f"--node {args.node}: that is {name} of {site.name}; {remedy}")
    if args.node is not None and args.node > MAX_NODE_ID and site.seals != "required" and not args.insider:
        remedy = f'give one up to {MAX_NODE_ID}, a site with seals = "required", or --insider'
        raise DemandError(f"--node {args.node}: that is a person's tool, and is believed; {remedy}")
    if args.insider and args.node is not None and not is_of_site and args.node <= MAX_NODE_ID:
        remedy = f"give one of those, a tool's from {MAX_NODE_ID + 1} to 255, or none"
        raise DemandError(f"--node {args.node}: no machine of {site.name}; {remedy}")
    for option, value, most in (("cars", args.cars, MOST_CARS), ("limit", args.limit, LONGEST_S)):
        if value is not None and not 0 < value <= most:
            raise DemandError(f"--{option} {value:g}: must be above 0, and at most {most}")
    if args.orders is not None:
        check_count("--orders", args.orders, MOST_ORDERS)
    if args.jobs < 0:
        raise DemandError(f"--jobs {args.jobs}: must be 1 or more; leave it out for one a core")
    system = simulated_of(site)
    demand = system.on(Occasion.ATTACK, site)
    if args.cars is not None or args.orders is not None:
        demand = system.usual(site, {"cars": args.cars, "orders": args.orders, "apart": demand.apart_s})
    return TrialSettings(args.site, args.node, args.limit, demand, args.insider, _begin_s(args.begin))


def _begin_s(given: str | None) -> tuple[float, float] | None:
    if given is None:
        return None
    moments = re.fullmatch(r"(\d+(?:\.\d+)?)-(\d+(?:\.\d+)?)", given)
    first_s, last_s = (float(one) for one in moments.groups()) if moments else (1.0, 0.0)
    if first_s > last_s:
        raise DemandError(f"--begin {given}: must be two moments in s, the first and the last, such as 0.05-6")
    return first_s, last_s


def _attacks(args: argparse.Namespace, site: Site) -> list[str]:
    is_believed = site.seals != "required" and not args.insider
    if args.attacks is None:
        return [name for name, entry in ATTACKS.items() if not (is_believed and entry.as_others)]
    named: list[str] = args.attacks.split(",")
    for name in named:
        if name not in ATTACKS:
            raise DemandError(f"--attacks {name}: no such attack; {nearest(name, list(ATTACKS))}")
        if is_believed and ATTACKS[name].as_others:
            remedy = f'{site.name} has no seals = "required", and would believe it; add --insider'
            raise DemandError(f"--attacks {name}: speaks under numbers of the site's machines; {remedy}")
    return list(dict.fromkeys(named))

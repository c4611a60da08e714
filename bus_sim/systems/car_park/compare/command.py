"""``bus-sim compare``: the price of having nobody in charge, as tables."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from bus_sim.demand import DemandError, read_seeds
from bus_sim.demand_options import add_table_options
from bus_sim.engine import Engine, add_where_options, engine_of, shown
from bus_sim.sites import find_site
from bus_sim.systems.car_park.compare.optimum import OptimumError, is_available
from bus_sim.systems.car_park.compare.plays import POLICIES, Play, Wanted, play_wanted
from bus_sim.systems.car_park.compare.small_table import SmallTable, solve_case
from bus_sim.systems.car_park.compare.stored_cases import GapTable, StoredCase, stored_cases
from bus_sim.systems.car_park.compare.table import ComparisonTable, named, tabulate
from bus_sim.systems.car_park.day import ParkingDay, asked_inside, brought_in, check_together, choose_demand
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.mapping import table_form
from bus_sim.systems.car_park.window import choose_window
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark, PlacePolicy

#: What the command can compare on.
PARTS = ("random", "day", "small", "stored")
#: How places can be chosen.
PLACES = tuple(one.value for one in PlacePolicy)
#: Where the optimum is looked for: one compartment, two robots.
SMALL_SITE = "small"
#: Small cases solved at most: a proof can take half a minute.
MOST_CASES = 5

HELP = """\
The same customers, plant, controllers, tokens and planner; only who decides who does what differs. The central
dispatchers read every robot's plans directly and pay nothing for it. Two bounds stand beside the waiting of each,
proven for its own runs: bays, doors and persons as they are and machines without way ("bays alone"), and each customer
alone in an empty park ("free flow"). All in virtual time: the figures are the same on every machine.

  random   cars at random intervals, in and out, for several seeds
  day      the busiest hour of a real day
  small    cases small enough for an exact optimum (needs OR-Tools: the extra "optimum")
  stored   forty cases that ship with their optima, which are proven anew: all known, and at each arrival and ticket

exit status: 0 all went well; 1 a run broke an invariant or left somebody waiting, or an optimum is not the stored one;
2 a mistake in the command line
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of ``compare``, and its description."""
    parser.description, parser.formatter_class = HELP, argparse.RawDescriptionHelpFormatter
    parser.add_argument("site", nargs="?", default="standard", help="name of a shipped site, or a site file")
    parser.add_argument("--seeds", default="1-10", metavar="A-B", help="seeds of the random parts (default: 1-10)")
    parser.add_argument("--cars", type=int, default=12, metavar="N", help="cars of each random run (default: 12)")
    parser.add_argument(
        "--random",
        nargs=2,
        type=float,
        default=(30.0, 15.0),
        metavar=("MEAN", "SIGMA"),
        help="intervals of arrivals, and of departures, in s (default: 30 15)",
    )
    parser.add_argument("--day", metavar="D", help="the day whose busiest hour is played (default: the shipped one)")
    parser.add_argument("--sessions", type=Path, metavar="FILE", help="sessions file of that day")
    add_table_options(parser)
    parser.add_argument(
        "--window", default="busiest", metavar="FROM-TO", help="another part of it, such as 06:30-09:00"
    )
    parser.add_argument(
        "--parts",
        default=",".join(PARTS),
        metavar="PART,...",
        help=f"which of {', '.join(PARTS)} (default: all)",
    )
    parser.add_argument(
        "--place",
        default="",
        metavar="POLICY,...",
        help=f"by which places are chosen, each of these with each who decides: {', '.join(PLACES)} "
        "(default: as the site file says)",
    )
    add_where_options(parser)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all tables as JSON too")


def run(args: argparse.Namespace) -> int:
    """Make the tables; the exit status. Raises ``DemandError`` for a person's mistake."""
    seeds, parts, engine = read_seeds(args.seeds), _parts(args.parts), engine_of(args, chunk=1)
    places = _places(args.place)
    site = find_site(args.site)
    if not isinstance(site, CarPark):
        raise DemandError(f"{args.site}: a {site.called}, and only car parks are compared; name a car park")
    small = find_site(SMALL_SITE)
    found: dict[str, ComparisonTable | SmallTable | GapTable] = {}
    for part in parts:
        if part == "small" and not is_available():
            print("no optimum: OR-Tools is not installed; pip install 'onboard-fleet[optimum]'\n", flush=True)
            continue
        if part == "random":
            found[part] = compare_random(site, seeds, args.cars, tuple(args.random), engine, places)
        elif part == "day":
            found[part] = compare_day(site, args, engine, places)
        elif part == "stored":
            found[part] = _solve_stored(engine)
        else:
            found[part] = _compare_small(small, seeds[:MOST_CASES])
        print("\n".join([*found[part].lines(), ""]), flush=True)
    if args.json is not None:
        values = {part: table.to_json() for part, table in found.items()}
        args.json.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    tables = [table for table in found.values() if isinstance(table, ComparisonTable)]
    is_wrong = any(isinstance(table, GapTable) and table.wrong for table in found.values())
    return 1 if is_wrong or any(table.faults or table.left_out for table in tables) else 0


def compare_random(
    site: CarPark,
    seeds: range,
    cars: int,
    interval_s: tuple[float, float],
    engine: Engine = map,
    places: Sequence[str] = ("",),
) -> ComparisonTable:
    """All policies on random arrivals. Raises ``DemandError`` for intervals that make no sense."""
    demands = {seed: Demand.by_mean(*interval_s, seed, count=cars) for seed in seeds}
    wanted = [
        Wanted(site, demands[seed], policy, seed, None, place)
        for seed in seeds
        for place in places
        for policy in POLICIES
    ]
    plays = _all_played(wanted, engine)
    title = (
        f"{site.name}: {cars} cars in and out at intervals of {interval_s[0]:g} s +- {interval_s[1]:g} s, "
        f"seeds {seeds[0]} to {seeds[-1]}"
    )
    return tabulate(title, plays)


def compare_day(
    site: CarPark, args: argparse.Namespace, engine: Engine = map, places: Sequence[str] = ("",)
) -> ComparisonTable:
    """All policies on a window of a real day: what comes before is played too, and not counted."""
    check_together(args)
    inside, overnight = asked_inside(args)
    day = ParkingDay(args.sessions, args.counts, table_form(args), inside, overnight, args.day)
    demand = choose_demand(day, site)
    window = choose_window(demand, args.window)
    demand = brought_in(demand, site)
    for remark in demand.remarks:
        print(remark, file=sys.stderr, flush=True)
    seed = 1
    before = Demand(tuple(stay for stay in demand.stays if stay.arrival_us < window.end_us), demand.zero)
    wanted = [Wanted(site, before, policy, seed, window, place) for place in places for policy in POLICIES]
    plays = _all_played(wanted, engine)
    return tabulate(f"{site.name}: {window.described(demand)}", plays)


def _compare_small(site: Site, seeds: range) -> SmallTable:
    cases = []
    for seed in seeds:
        try:
            cases.append(solve_case(site, seed))
            print(f"small case {seed}: optimum {cases[-1].optimum_s:.1f} s", file=sys.stderr, flush=True)
        except OptimumError as error:
            print(f"small case {seed} left out: {error}", file=sys.stderr, flush=True)
    if not cases:
        raise DemandError("--parts small: no case of these seeds could be solved; try others")
    return SmallTable(site.name, tuple(cases))


def _solve_stored(engine: Engine) -> GapTable:
    """All stored cases solved anew, and which of them then came to something else."""
    cases = stored_cases()
    anew = {
        one.name: one for one in shown(engine(StoredCase.solved_anew, cases), len(cases), "cases", Console(stderr=True))
    }
    values = [((one.clairvoyant_ms, one.resolved_ms), anew[one.name]) for one in cases]
    wrong = (
        f"{one.name}: stored {stored[0]} and {stored[1]} ms, found {one.clairvoyant_ms} and {one.resolved_ms} ms"
        for stored, one in values
        if stored != (one.clairvoyant_ms, one.resolved_ms)
    )
    return GapTable.of(tuple(one for _, one in values), tuple(wrong))


def _all_played(wanted: list[Wanted], engine: Engine) -> list[Play]:
    """All plays in the order in which they were wanted, whoever played them."""
    results = shown(engine(play_wanted, wanted), len(wanted), "plays", Console(stderr=True))
    order = {(one.seed, one.place, one.policy): number for number, one in enumerate(wanted)}
    return sorted(map(_told, results), key=lambda one: order[one.seed, one.place, one.policy])


def _told(one: Play) -> Play:
    waits_us = one.in_us + one.out_us
    mean_s = sum(waits_us) / len(waits_us) / 1e6 if waits_us else 0.0
    told = f"seed {one.seed}, {named(one.policy, one.place)}: waiting {mean_s:.1f} s, {one.left} not served"
    print(told, file=sys.stderr, flush=True)
    return one


def _places(text: str) -> list[str]:
    places = text.split(",") if text else [""]
    if text and not set(places) <= set(PLACES):
        raise DemandError(f"--place {text}: must be some of {', '.join(PLACES)}")
    return list(dict.fromkeys(places))


def _parts(text: str) -> list[str]:
    parts = [part for part in text.split(",") if part]
    unknown = [part for part in parts if part not in PARTS]
    if unknown or not parts:
        raise DemandError(f"--parts {text}: must be some of {', '.join(PARTS)}")
    return parts

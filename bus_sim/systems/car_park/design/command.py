"""``bus-sim design``: how many robots, lifts and compartments a demand needs."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Any

from rich.console import Console

from bus_sim.demand import DemandError
from bus_sim.demand_options import add_table_options
from bus_sim.engine import add_where_options, engine_of, shown
from bus_sim.sites import find_site, site_text
from bus_sim.systems.car_park.design.days import days_of
from bus_sim.systems.car_park.design.options import parse_range, size_of
from bus_sim.systems.car_park.design.picture import draw
from bus_sim.systems.car_park.design.search import Design, DesignTarget, Search
from bus_sim.systems.car_park.design.table import lines, to_json
from onboard.systems.car_park.site import CarPark

#: More of a kind than this is no option: a site has 250 machines, and 64 lifts.
MOST_ROBOTS, MOST_LIFTS, MOST_COMPARTMENTS = 100, 64, 100
#: Options of one search at most: each is some twenty days of the model.
MOST_OPTIONS = 2_000
#: Days at most: each is read and modelled for every option.
MOST_DAYS = 250
#: Longest time that may be asked for: a day, s and h.
LONGEST_S, LONGEST_H = 86_400.0, 240.0

HELP = """\
Every size within the ranges is made of the site file and played in a fast model: people, compartments, robots and
lifts with the site's own times, nobody sends a message. The cheapest that keeps the target on 95 % of the days is then
played in the plant, with all machines on their bus, and its neighbours beside it. Where the plant waits longer than the
model, the model is corrected by that and the search goes on.

exit status: 0 a site was found that keeps the target; 1 none of them does; 2 a mistake in the command line or in a file

example:
  bus-sim design small --sessions garage.csv --robots 1-4 --lifts 1-2 --compartments 1-3 --wait 180 --unseen 20 \\
      --out winner.toml --draw design.svg
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of ``design``, and its description."""
    parser.description, parser.formatter_class = HELP, argparse.RawDescriptionHelpFormatter
    parser.add_argument("site", help="name of a shipped car park, or a site file: the building that is equipped")
    sizes = parser.add_argument_group("sizes to choose from (default: as in the site file)")
    for kind in ("robots", "lifts", "compartments"):
        sizes.add_argument(f"--{kind}", metavar="A-B", help=f"from the fewest to the most {kind}")
    sizes.add_argument(
        "--prices",
        nargs=3,
        type=float,
        default=(1.0, 1.0, 1.0),
        metavar=("ROBOT", "LIFT", "COMPARTMENT"),
        help="what one costs beside the others (default: 1 1 1, so fewest machines in all)",
    )
    target = parser.add_argument_group("what it has to do")
    target.add_argument(
        "--wait", type=float, required=True, metavar="SECONDS", help="95 %% of waits in, and of waits out, within this"
    )
    target.add_argument("--fill", type=float, default=inf, metavar="HOURS", help="all places filled within this")
    target.add_argument("--empty", type=float, default=inf, metavar="HOURS", help="all cars fetched within this")
    demand = parser.add_argument_group("who comes (default: the shipped real day, 2019-07-24)")
    demand.add_argument("--sessions", type=Path, metavar="FILE", help="sessions file (CSV; docs/demand.md)")
    add_table_options(demand)
    demand.add_argument("--day", metavar="D[..D]", help="only this day of the table, or from the first to the last")
    demand.add_argument(
        "--days", type=int, default=20, metavar="N", help="working days to search by, or seeds of one day (default: 20)"
    )
    demand.add_argument(
        "--unseen", type=int, default=0, metavar="N", help="keep so many other days back, and play them in the plant"
    )
    how = parser.add_argument_group("how")
    how.add_argument("--no-plant", action="store_true", help="the model alone")
    how.add_argument(
        "--plant-days", type=int, default=1, metavar="N", help="hardest days that the winner plays (default: 1)"
    )
    add_where_options(parser)
    parser.add_argument("--out", dest="out_file", type=Path, metavar="FILE", help="write the winner's site file")
    parser.add_argument("--draw", type=Path, metavar="FILE", help="draw it, as SVG")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures as JSON too")


def run(args: argparse.Namespace) -> int:
    """The command. Raises ``DemandError`` for a mistake in the command line or a table."""
    search = _search(args)
    design = search.run(has_plant=not args.no_plant)
    print("\n".join(lines(design)))
    _write(args, design, search.name)
    return 0 if design.winner is not None else 1


def _search(args: argparse.Namespace) -> Search:
    site = find_site(args.site)
    if not isinstance(site, CarPark):
        raise DemandError(f"{args.site}: a {site.called}, and only car parks are designed; name a car park")
    target = _target(args)
    _check_counts(args)
    own = size_of(site)
    ranges = (
        _range("--robots", args.robots, own.robots, 1, MOST_ROBOTS),
        _range("--lifts", args.lifts, own.lifts, 0, MOST_LIFTS),
        _range("--compartments", args.compartments, own.compartments, 1, MOST_COMPARTMENTS),
    )
    count = len(ranges[0]) * len(ranges[1]) * len(ranges[2])
    if count > MOST_OPTIONS:
        raise DemandError(f"--robots, --lifts, --compartments: {count} sizes; give ranges of {MOST_OPTIONS} at most")
    days = days_of(args, site)
    for remark in days.remarks:
        print(remark, file=sys.stderr, flush=True)
    name = Path(args.site).name.removesuffix(".toml")
    engine = _Shown(args)
    return Search(
        site_text(args.site), f"{name}.toml", ranges, tuple(args.prices), target, days, engine, args.plant_days
    )


class _Shown:
    """Plays trials where the options say, with a bar."""

    def __init__(self, args: argparse.Namespace) -> None:
        # A run in the plant takes a minute: each is a task of its own.
        self._console, self._play, self._single = Console(stderr=True), engine_of(args), engine_of(args, chunk=1)

    def __call__(self, what: str, function: Callable[[Any], Any], items: Sequence[Any], /) -> Iterator[Any]:
        play = self._single if what == "plant" else self._play
        return shown(play(function, items), len(items), what, self._console)


def _target(args: argparse.Namespace) -> DesignTarget:
    for option, value, most, unit in (
        ("--wait", args.wait, LONGEST_S, "s"),
        ("--fill", args.fill, LONGEST_H, "h"),
        ("--empty", args.empty, LONGEST_H, "h"),
    ):
        if value != inf and not 0 < value <= most:
            raise DemandError(f"{option} {value:g}: must be above 0 {unit}, and at most {most:g}")
    if args.wait == inf:
        raise DemandError("--wait inf: must be a time in s")
    return DesignTarget(args.wait, args.fill, args.empty)


def _check_counts(args: argparse.Namespace) -> None:
    for option, value, least in (
        ("--days", args.days, 1),
        ("--unseen", args.unseen, 0),
        ("--plant-days", args.plant_days, 1),
    ):
        if not least <= value <= MOST_DAYS:
            raise DemandError(f"{option} {value}: must be from {least} to {MOST_DAYS}")
    if args.unseen and args.no_plant:
        raise DemandError(f"--unseen {args.unseen}: these days are played in the plant; leave --no-plant out")
    bad = [price for price in args.prices if not 0 <= price < inf]
    if bad:
        raise DemandError(f"--prices {bad[0]:g}: must be 0 or more")


def _range(option: str, text: str | None, own: int, least: int, most: int) -> range:
    return range(own, own + 1) if text is None else parse_range(option, text, least, most)


def _write(args: argparse.Namespace, design: Design, name: str) -> None:
    if args.json is not None:
        args.json.write_text(json.dumps(to_json(design), indent=2) + "\n", encoding="utf-8")
    if design.winner is None:
        return
    if args.out_file is not None:
        head = f"# Made by bus-sim design of {name}: {design.winner.size}.\n\n"
        args.out_file.write_text(head + design.winner.option.text, encoding="utf-8")
        print(f"written to {args.out_file}; run it: bus-sim run {args.out_file}")
    if args.draw is not None:
        args.draw.write_text(str(draw(design, name.removesuffix(".toml"))), encoding="utf-8")

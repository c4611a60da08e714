"""Sites drawn by chance, each played under a campaign's faults: a building, a hall, a yard that nobody thought of.

    python -m bench.drawn [1-8] [--system car-park] [--faults all] [--out DIR]
    python -m bench.drawn 1-8 --constants
    python -m bench.drawn 7 --print

The number of a site is its seed: its file is drawn from that alone, as are its customers or orders, and its faults.
What the loader refuses is drawn anew. The site file of one that failed is kept beside its scenario and its trace.
With ``--constants`` a site's times, speeds and lengths are drawn as well, which else are those of a shipped one.
Virtual time: the same on every machine. Exit status 1 where one failed.
"""

import argparse
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from bench import _drawn_lines, _drawn_plants
from bench._drawn_car_park import DrawnCarPark
from bench._drawn_constants import with_constants
from bench._drawn_tables import Tables, site_text
from bus_sim.campaign.profiles import profile_names
from bus_sim.campaign.report import FAILURES
from bus_sim.campaign.runner import CampaignSettings, TrialResult, run_seed
from bus_sim.demand import DemandError, read_seeds
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site

#: Most drawings that the loader may refuse before a site is given up.
MOST_DRAWINGS = 2_000
#: What is drawn of each system.
DRAWN: dict[str, Callable[[str, random.Random], Tables]] = {
    "car-park": lambda name, draw: DrawnCarPark(name, draw).tables(),
    "lines": _drawn_lines.lines,
    "graph": _drawn_plants.graph,
    "terminal": _drawn_plants.terminal,
    "cell": _drawn_plants.cell,
    "turning": _drawn_plants.turning,
    "mapd": _drawn_plants.mapd,
}
#: Those of them that are car parks.
PARKS = ("car-park", "lines")


def drawn_site(system: str, number: int, *, constants: bool = False) -> str:
    """The site file ``number`` of a system, the first of its drawings that the loader takes.

    With ``constants`` of its own where that is asked for.
    Raises ``RuntimeError`` where it takes none of ``MOST_DRAWINGS``.
    """
    for drawing in range(MOST_DRAWINGS):
        draw = random.Random(f"{system} {number}, drawing {drawing}")
        tables = DRAWN[system](f"d{number}", draw)
        text = site_text(with_constants(tables, draw, is_park=system in PARKS) if constants else tables)
        try:
            parse_site(text, f"d{number}.toml")
        except ConfigError:
            continue
        return text
    raise RuntimeError(f"{system} {number}: none of {MOST_DRAWINGS} drawings is a site")


def played(numbers: range, options: argparse.Namespace) -> Iterator[TrialResult]:
    """Each site under its own customers and faults; the site files of those that failed stay in ``options.out``."""
    options.out.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        file = options.out / f"d{number}.toml"
        file.write_text(drawn_site(options.system, number, constants=options.constants), encoding="utf-8")
        site = find_site(str(file))
        is_park = site.system == "car-park"
        comes = {"cars": options.cars if is_park else None, "apart": options.apart, "orders": options.orders}
        demand = simulated_of(site).usual(site, comes)
        plan = CampaignSettings(str(file), options.faults, options.limit, demand, out=options.out, has_baseline=False)
        result = run_seed(plan, number)
        if result.report.verdict not in FAILURES:
            file.unlink()
        yield result


def line_of(result: TrialResult) -> str:
    """What came of one site, on one line."""
    report = result.report
    told = f"served {report.served}, told why {report.told}, waiting {report.waiting}, {report.simulated_s:.0f} s"
    why = f"; {report.why()}" if report.verdict in FAILURES else ""
    return f"site {result.seed}: {report.verdict.value}, {told}{why}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Play them, one after another."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sites", nargs="?", default="1-8", help="a number, or the first and the last of several")
    parser.add_argument("--system", default="car-park", choices=DRAWN, help="lines: a car park with lifts in line")
    parser.add_argument("--faults", default="all", help="a profile of bus-sim campaign, or several with commas between")
    parser.add_argument("--constants", action="store_true", help="times, speeds and lengths are drawn as well")
    parser.add_argument("--cars", type=int, default=12, help="in a car park")
    parser.add_argument("--orders", type=int, help="on any other site")
    parser.add_argument("--apart", type=float, metavar="SECONDS", help="mean time between two that come")
    parser.add_argument("--limit", type=float, default=7_200.0, metavar="SECONDS", help="longest run")
    parser.add_argument("--out", type=Path, default=Path("drawn"), metavar="DIR", help="what failed is kept here")
    parser.add_argument("--print", action="store_true", dest="prints", help="the site files, and play nothing")
    options = parser.parse_args(arguments)
    try:
        numbers = read_seeds(options.sites)
        profile_names(options.faults)
    except DemandError as error:
        parser.error(str(error).removeprefix("--seeds "))
    if options.prints:
        print("\n".join(drawn_site(options.system, number, constants=options.constants) for number in numbers), end="")
        return 0
    failed = 0
    for result in played(numbers, options):
        print(line_of(result), flush=True)
        failed += result.report.verdict in FAILURES
    print(f"{len(numbers)} sites, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

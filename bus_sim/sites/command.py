"""``bus-sim sites``: which ship, what one holds and can lose, and a drawing of it."""

import argparse
import sys
from pathlib import Path

from bus_sim.commands import OptionError
from bus_sim.sites import find_site, layout_names, site_names
from onboard.config.site_report import site_report
from onboard.systems.registry import part


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which site, and where its drawing goes."""
    parser.add_argument("site", nargs="?", help="name of a shipped site, or a site file")
    parser.add_argument("--draw", metavar="FILE", help="draw the building to scale, as SVG (- for standard output)")


def run(args: argparse.Namespace) -> int:
    """Tell of them. Raises ``OptionError``, and ``SiteNotFoundError`` for an unknown site."""
    if args.draw is None:
        known = [*site_names(), *layout_names()]
        print("\n".join(known if args.site is None else site_report(find_site(args.site))))
        return 0
    if args.site is None:
        raise OptionError("--draw: of which site? name one before it")
    site = find_site(args.site)
    building = part(site.system, "building")
    if building is None:
        raise OptionError(f"--draw: no drawing of a {site.called} by itself; bus-sim run {args.site} --web shows it")
    if args.draw == "-":
        sys.stdout.write(str(building.draw(site)))
        return 0
    Path(args.draw).write_text(str(building.draw(site)), encoding="utf-8")
    print("\n".join([*site_report(site), f"drawn: {args.draw}"]))
    return 0

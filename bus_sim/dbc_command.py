"""``bus-sim dbc``: a site's messages, one for each machine, for stock tools."""

import argparse
import sys

from bus_sim.sites import find_site
from onboard.wire.site_dbc import site_dbc


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which site; of the simplest one where none is named."""
    parser.add_argument("site", nargs="?", default="level1", help="name of a shipped site, or a site file")


def run(args: argparse.Namespace) -> int:
    """Print it. Raises ``SiteNotFoundError`` for an unknown site."""
    sys.stdout.write(site_dbc(find_site(args.site)))
    return 0

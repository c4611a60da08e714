"""``onboard trace load``: bus load, and response times beside their computed worst case."""

import argparse
import sys

from onboard.systems.contract import codecs_for
from onboard.trace.commands.common import (
    Commands,
    TraceError,
    add_command,
    add_log,
    add_site,
    open_log,
    site_of,
    tell_faults,
)
from onboard.trace.load import bounds_of, load_lines, loads

HELP = """\
"at most" is the time from the beginning of the busy stretch in which a frame was sent to the frame's end: a log tells
no more. "bound" is the worst case while a site runs, of nodes with one queue in order, as ours are; "by priority" of
nodes that always offer their most urgent frame. Faults on the bus, and all machines starting together, are beyond it.

examples:
  onboard trace load run.log --site bus_sim/sites/small.toml
  onboard trace load car.log --bitrate 250000
"""
_BIT_RATE = 500_000


def register(commands: Commands) -> None:
    """Add ``load`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "load", "bus load and response times, beside their worst case", HELP, run)
    add_log(parser)
    add_site(parser)
    parser.add_argument("--bitrate", type=int, metavar="BIT/S", help=f"default: the site's, else {_BIT_RATE}")


def run(args: argparse.Namespace) -> int:
    """Print load and response times of each bus of the log. Raises ``TraceError`` for a rate below 1 bit/s."""
    site = site_of(args)
    bit_rate: int = args.bitrate or (site.bitrate if site is not None else _BIT_RATE)
    if bit_rate < 1:
        raise TraceError(f"--bitrate {bit_rate}: give bit/s above 0, such as 500000")
    with open_log(args) as log:
        found = loads(log, codecs_for(site), bit_rate)
    bounds = bounds_of(site) if site is not None else {}
    start_us = min((load.first_us for load in found.values() if load.first_us is not None), default=0)
    print("\n".join(load_lines(found.values(), bounds, start_us)))
    sys.stdout.flush()
    tell_faults(log)
    return 0

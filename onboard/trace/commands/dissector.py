"""``onboard trace dissector``: a Wireshark dissector generated from the DBC."""

import argparse
import sys
from pathlib import Path

from onboard.config.site import load_site
from onboard.systems.registry import system_of
from onboard.trace.commands.common import Commands, add_command

HELP = """\
examples:
  onboard trace dissector bus_sim/sites/small.toml > onboard.lua
  onboard trace convert run.log run.pcapng
  tshark -X lua_script:onboard.lua -r run.pcapng -Y 'onboard.bid.cost > 90000 && onboard.sender.name == "MR1"'
"""


def register(commands: Commands) -> None:
    """Add ``dissector`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "dissector", "print a Wireshark dissector (Lua) of the DBC", HELP, run)
    parser.add_argument("site", nargs="?", type=Path, metavar="SITE", help="site file: its machines' names, its system")


def run(args: argparse.Namespace) -> int:
    """Print the dissector, in Lua, on standard output; exit status 0."""
    from onboard.trace.dissector import dissector  # noqa: PLC0415  # reading DBC files takes a third of the start

    site = load_site(args.site) if args.site is not None else None
    sys.stdout.write(dissector(site, system_of(site).name if site is not None else ""))
    return 0

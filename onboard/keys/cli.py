"""``onboard keys``: makes the keys of a site that has seals."""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from onboard.config.arguments import Parser, whole
from onboard.config.problems import ConfigError
from onboard.config.site import load_site
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Site
from onboard.keys.agreement import KeysError
from onboard.keys.folder import KeyFolder, refuse_checkout
from onboard.keys.tickets import desks_of, write_tickets

HELP = """\
One folder holds the secret identities (X25519) of all machines of a site; keep it where only you can read it, and not
on a machine. Put each NAME.keys on its board as JOURNAL.keys, beside the journal's folder, mode 0600. A board that is
replaced gets its file newly written: make again, then copy. A stolen board: renew its machine, then put the new
file on every board, as the group's key is another one, too.

tickets, for a car park, with or without seals: one file for the boards of all compartments, as JOURNAL.tickets, mode
0600. Again: tickets are printed under a new secret, those under the one before still count, older ones no more.

exit status:
  0  every file is written
  2  a mistake in the command line or the site file, or openssl is not installed

examples:
  onboard keys make site.toml
  onboard keys renew site.toml MR1
  onboard keys tickets site.toml
"""
_LAST_NODE_ID = 255
_COMMANDS = {
    "make": "make what is missing, and write every file anew",
    "renew": "new keys of machines",
    "tickets": "a new secret for the tickets of all desks",
}


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard keys``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard keys",
        description="Make the keys of a site's machines and of people's tools, and of its tickets.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, what in _COMMANDS.items():
        command = commands.add_parser(name, help=what, description=what)
        command.add_argument("site", type=Path, help="site file, or the name of a shipped site")
        if name == "renew":
            command.add_argument("machines", nargs="+", metavar="MACHINE", help="whose identity is made anew")
        command.add_argument("--folder", type=Path, metavar="DIR", help="where they are kept (default: SITE-keys)")
        if name == "tickets":
            continue
        command.add_argument(
            "--tools", default="251", metavar="N,N", help="node-IDs of people's tools that get keys (default: 251)"
        )
    return parser


def main(argv: Sequence[str]) -> int:
    """Entry point; returns the exit status."""
    args = build_parser().parse_args(argv)
    try:
        site = load_site(args.site)
        place = args.folder or Path(f"{site.name}-keys")
        if args.command == "tickets":
            return _write_tickets(place, site)
        folder = KeyFolder(place, site, _tools(args.tools, site))
        if args.command == "renew":
            folder.renew(args.machines)
        made = folder.write(round(time.time()))
    except (ConfigError, KeysError) as error:
        print(error if isinstance(error, ConfigError) else f"onboard keys: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"onboard keys: {error.filename}: {error.strerror}; name another folder with --folder", file=sys.stderr)
        return 2
    width = max(len(one.name) for one in made)
    for one in made:
        print(f"{one.name:<{width}}  node {one.node:>3}  {one.fingerprint}  {one.file}")
    return 0


def _write_tickets(place: Path, site: Site) -> int:
    desks = desks_of(site)
    refuse_checkout(place)
    path, count = write_tickets(place)
    still = "; tickets under the one before still count" if count > 1 else ""
    print(f"{path}: put it on the board of {', '.join(desks)} as JOURNAL.tickets, mode 0600{still}")
    return 0


def _tools(text: str, site: Site) -> list[int]:
    words = text.split(",") if text else []
    for word in words:
        number = whole(word)
        if number is None or not MAX_NODE_ID < number <= _LAST_NODE_ID:
            raise KeysError(f"--tools {word}: is no node-ID of a tool of {site.name}; write 251 to 255")
    return sorted({int(word) for word in words})

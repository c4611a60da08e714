"""``onboard operate``: what a person says to a site from any node of its bus."""

import argparse
import asyncio
import contextlib
import sys
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from pathlib import Path

from onboard.config.arguments import Parser, seconds
from onboard.config.keys import tool_keys
from onboard.config.problems import ConfigError
from onboard.config.site import load_site
from onboard.config.site_change import added_machines
from onboard.core.site import Site
from onboard.io.open_bus import BusOpenError, BusSettings, add_site_arguments, bus_settings, open_bus, parse_with_bus
from onboard.io.seal_lives import SealLivesError
from onboard.io.sealed_bus import sealed_bus
from onboard.io.signals import ended_by
from onboard.operate.asking import Asker
from onboard.operate.commands import CommandRequest, Maker, maker_of
from onboard.operate.names import OperateError, tool_of
from onboard.operate.order import MISTAKE
from onboard.operate.station import OperatorStation
from onboard.ports.bus import Bus
from onboard.seal.keys import Keys
from onboard.systems.contract import codecs_for

EXAMPLES = """\
exit status: 0 done, and confirmed by those whom it concerns; 1 not confirmed, it says by whom; 2 a person's mistake

stop, hold and block only take motion away: they are said at once. All others ask first; --yes answers for a script.

examples:
  onboard operate status -i socketcan -c can0 --site mysite.toml         who lives, who stands and why; only listens
  onboard operate stop -i socketcan -c can0 --site mysite.toml           all stand, until Ctrl-C and 30 s more
  onboard operate go -i socketcan -c can0 --site mysite.toml             who stands and why; asks; they go on
  onboard operate block "p(1,3)" -i socketcan -c can0 --site mysite.toml
  onboard operate regenerate MR1 --body 'p(1,3)' -i socketcan -c can0 --site mysite.toml
  onboard operate hold MR1 -i socketcand-asyncio -c fleet --bus-kwargs host=127.0.0.1 port=29536 --site small.toml
      the same on a site served by: bus-sim run small --serve
This bus is no safety channel: machines that can hurt somebody have an emergency stop of their own.
"""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard operate``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard operate",
        description="Tell a site what a person has decided, on its own bus (docs/operate.md).",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    common = argparse.ArgumentParser(add_help=False)
    add_site_arguments(common)
    common.add_argument(
        "--node",
        type=int,
        metavar="NODE",
        help="speak under this node-ID, 251 to 255, that nobody else there has (default: the lowest that is not heard)",
    )
    common.add_argument("--keys", type=Path, metavar="FILE", help="this tool's keys, where the site has seals")
    common.add_argument("--yes", action="store_true", help="do not ask")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, help_text: str) -> argparse.ArgumentParser:
        return commands.add_parser(name, parents=[common], help=help_text, description=help_text)

    status = command("status", "who lives, who stands and why; only listens")
    status.add_argument("--for", type=seconds, dest="for_s", metavar="SECONDS", help="listen for so long")
    stop = command("stop", "all machines stand, as long as this runs and 30 s more")
    stop.add_argument(
        "--for", type=seconds, dest="for_s", metavar="SECONDS", help="end by itself then; 0: once all have answered"
    )
    command("go", "lift the emergency stop").add_argument(
        "--of", metavar="NODE", help="only the stop said by this machine or node-ID (default: all stops)"
    )
    block = command("block", "a segment cannot be passed, until clear")
    block.add_argument("segment", metavar="SEGMENT", help="such as 'p(1,3)'")
    block.add_argument("--reason", default="operator", help="a reason of the DBC (default: %(default)s)")
    command("clear", "a segment can be passed again").add_argument(
        "segment", metavar="SEGMENT", help="such as 'p(1,3)'"
    )
    command("hold", "a machine comes to rest, and stands").add_argument("machine", metavar="MACHINE")
    command("release", "a machine that is held goes on").add_argument("machine", metavar="MACHINE")
    change = command("change-site", "a new site file (--site), with more machines, is rolled out while the site works")
    change.add_argument("old", type=Path, metavar="OLD", help="the site file that it follows")
    regenerate = command("regenerate", "the rights of a machine whose journal is lost are made anew")
    regenerate.add_argument("machine", metavar="MACHINE", help="whose rights; it holds, or is --absent")
    regenerate.add_argument("--absent", default="", metavar="MACHINE", help="a machine that is off and locked off")
    for option, whose in (("--body", "the machine"), ("--absent-body", "another machine that is --absent")):
        regenerate.add_argument(
            option,
            action="append",
            default=[],
            metavar="SLOT",
            help=f"where the body of {whose} is: 'p(1,3)', or a lift's name for its platform; gone: nowhere",
        )
    regenerate.add_argument(
        "--locked-off", default="", metavar="MACHINE", help="with --yes: the name that would have to be typed"
    )
    return parser


def main(argv: Sequence[str]) -> int:
    """Entry point; returns the exit status."""
    args = parse_with_bus(build_parser(), argv)
    try:
        site = load_site(args.site)
        if args.node is not None:
            tool_of(args.node)
        # Another life of this station begins elsewhere in the numbers of orders.
        asked = request_of(args)
        if args.command == "change-site":
            old = load_site(args.old)
            added_machines(old, site, str(args.site))
            asked = replace(asked, replaces=old.digest)
        make = maker_of(site, asked, seed=time.time_ns() // 1_000_000_000)
        settings = bus_settings(args, BusSettings(interface="", channel="", bitrate=site.bitrate))
        keys = None if args.command == "status" else tool_keys(args.keys, site, args.node)
        return asyncio.run(_run(args, site, settings, make, keys))
    except (ConfigError, BusOpenError, OperateError, SealLivesError) as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"onboard operate: {line}", file=sys.stderr)
        return MISTAKE


def request_of(args: argparse.Namespace) -> CommandRequest:
    """What a command line asks for."""
    for_s = getattr(args, "for_s", None)
    return CommandRequest(
        args.command,
        machine=getattr(args, "machine", ""),
        segment=getattr(args, "segment", ""),
        reason=getattr(args, "reason", "operator"),
        of=getattr(args, "of", None) or "",
        absent=getattr(args, "absent", ""),
        body=tuple(getattr(args, "body", ())),
        absent_body=tuple(getattr(args, "absent_body", ())),
        for_us=None if for_s is None else round(for_s * 1e6),
    )


async def _run(args: argparse.Namespace, site: Site, settings: BusSettings, make: Maker, keys: Keys | None) -> int:
    plain = await open_bus(settings)
    bus: Bus = plain
    codec, node = codecs_for(site).fleet, args.node
    if keys is not None:
        node = keys.node
        bus = await sealed_bus(plain, site, keys, args.keys, codec.decode_part)
    station = OperatorStation(site, codec, bus, _tell)
    loop = asyncio.get_running_loop()
    lost = loop.create_task(_watch(plain.wait_lost, station))
    try:
        # A terminal that is closed in the midst of a regeneration breaks it off as Ctrl-C does: all would stand else.
        with ended_by(loop, lambda _: station.interrupt()):
            asker = Asker(station, _tell, is_agreed=args.yes, typed=getattr(args, "locked_off", ""))
            return await station.operate(make, node, asker.agrees)
    finally:
        lost.cancel()
        await bus.close()


async def _watch(wait_lost: Callable[[], Awaitable[str]], station: OperatorStation) -> None:
    station.lose(await wait_lost())


def _tell(line: str) -> None:
    # Of a terminal that is closed nobody reads; what was begun must still be ended on the bus.
    with contextlib.suppress(OSError):
        print(line, flush=True)

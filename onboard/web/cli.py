"""``onboard web``: the page for a live bus that is only listened to, or for a recorded log with a slider."""

import argparse
import asyncio
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from onboard.config.arguments import Parser
from onboard.config.keys import load_keys
from onboard.config.problems import ConfigError
from onboard.config.site import load_site
from onboard.core.site import Site
from onboard.io.kept_token import kept_token
from onboard.io.open_bus import BusOpenError, BusSettings, add_bus_arguments, bus_settings, open_bus
from onboard.io.owned_file import OwnedFileError
from onboard.io.signals import ended_by
from onboard.seal.keys import Keys
from onboard.systems.contract import codecs_for
from onboard.trace.readers.open_log import Log, LogOpenError
from onboard.web.address import DEFAULT_PORT, WebError
from onboard.web.film import Film
from onboard.web.live import LiveSource, LogSource
from onboard.web.serve import WebServer

EXAMPLES = """\
exit status: 0 stopped by a person; 1 the bus is gone or not there yet; 2 a mistake in the command line or in a file

examples:
  onboard web -i socketcan -c can0 -b 500000 --site mysite.toml     a real bus: listened to, never spoken on
  onboard web -i socketcand -c fleet --bus-kwargs host=127.0.0.1 port=29536 --site mysite.toml
  onboard web trace.log --site mysite.toml                          a recorded log, with a slider
"""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard web``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard web",
        description="Show a site as its bus tells it, on a page of this computer.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "log", nargs="?", metavar="LOG", help="a log instead of a bus: candump -L, Vector ASC or pcapng"
    )
    parser.add_argument("--site", type=Path, required=True, metavar="SITE", help="site file, or a shipped site's name")
    parser.add_argument(
        "--web",
        default=f"127.0.0.1:{DEFAULT_PORT}",
        metavar="[HOST:]PORT",
        help="where (default: %(default)s)",
    )
    parser.add_argument(
        "--web-token",
        type=Path,
        metavar="FILE",
        help="keep the token of the printed address here, so that it stays (made where missing; default: a new one)",
    )
    parser.add_argument(
        "--keys", type=Path, metavar="FILE", help="a key file of a site with seals: tell whose seals are right"
    )
    add_bus_arguments(parser)
    return parser


def main(argv: Sequence[str]) -> int:
    """Entry point; returns the exit status."""
    parser = build_parser()
    args = parser.parse_args(argv)
    if args.log is None and not hasattr(args, "interface"):
        parser.error("name a log, or a bus: -i INTERFACE -c CHANNEL")
    try:
        site, token = load_site(args.site), web_token(args.web_token)
        keys, codec = _keys(args.keys, site), codecs_for(site)
        if args.log is not None:
            with Film(site, codec, keys) as film:
                _read(film, args.log)
                return asyncio.run(_show_log(film, args.web, token))
        settings = bus_settings(args, BusSettings(interface="", channel="", bitrate=site.bitrate))
        return asyncio.run(_show_bus(partial(LiveSource, site, codec, keys), settings, args.web, token))
    except (ConfigError, BusOpenError, LogOpenError, WebError) as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"onboard web: {line}", file=sys.stderr)
        return 1 if isinstance(error, BusOpenError) and error.may_come else 2


def web_token(path: Path | None) -> str | None:
    """The token that is kept in a file; None for none. Raises ``WebError``."""
    try:
        return None if path is None else kept_token(path)
    except OwnedFileError as error:
        raise WebError(f"--web-token {error}") from error


def _keys(path: Path | None, site: Site) -> Keys | None:
    if path is not None and site.seals == "off":
        raise WebError(f"--keys {path}: {site.name} has no seals; leave it out")
    return None if path is None else load_keys(path, site)


def _read(film: Film, name: str) -> None:
    """The whole log, with a bar on standard error where that is a terminal; what was wrong with it is told there."""
    with Log(name, bar=sys.stderr) as log:
        try:
            film.read(log)
        except LogOpenError:
            raise
        except ValueError as error:
            raise WebError(f"{name}: {error}; name a log of this site") from error
        for line in log.faults.lines():
            print(f"{name}: {line}", file=sys.stderr)


async def _show_log(film: Film, where: str, token: str | None) -> int:
    source = LogSource(film)
    playing = asyncio.get_running_loop().create_task(source.play())
    try:
        return await _serve(WebServer(source, where, token), None)
    finally:
        playing.cancel()


async def _show_bus(listens: Callable[[], LiveSource], settings: BusSettings, where: str, token: str | None) -> int:
    source = listens()
    bus = await open_bus(settings)
    bus.subscribe(source.on_frame)
    lost = asyncio.get_running_loop().create_task(bus.wait_lost())
    try:
        return await _serve(WebServer(source, where, token), lost)
    finally:
        lost.cancel()
        await bus.close()


async def _serve(server: WebServer, lost: asyncio.Task[str] | None) -> int:
    """Until a signal ends it, or the bus is gone."""
    status = 0

    def on_lost(task: asyncio.Task[str]) -> None:
        nonlocal status
        if not task.cancelled():
            status = 1
            print(f"onboard web: the bus is gone: {task.result()}", file=sys.stderr)
            server.stop()

    if lost is not None:
        lost.add_done_callback(on_lost)
    print(f"picture at {server.address}", flush=True)
    with ended_by(asyncio.get_running_loop(), lambda _: server.stop()):
        await server.run()
    return status

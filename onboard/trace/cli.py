"""``onboard trace``: look at a log of a bus. Loaded only where it is asked for: no part of a controller."""

import argparse
import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from onboard.config.problems import ConfigError
from onboard.config.site import load_site
from onboard.core.site import Site
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.check.checks import Checks, Verdict, check_records
from onboard.trace.check.systems import checks_for
from onboard.wire.codec import Codec
from onboard.wire.dbc_file import read_layouts

HELP = """\
exit status:
  0  no rule was broken
  1  a rule was broken; each finding is one line with its time, its machines and the frame that shows it
  2  a mistake in the command line or in a file; one line says where and what to do

examples:
  onboard trace check trace.log --site bus_sim/sites/standard.toml
  bus-sim run small --trace run.log --devices && onboard trace check run.log --site bus_sim/sites/small.toml
  candump -L can0 | onboard trace check - --site mysite.toml
"""


class TraceError(ValueError):
    """A person's mistake: one clear line."""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard trace``."""
    parser = argparse.ArgumentParser(
        prog="onboard trace",
        description="Look at what was on a bus: from the log and the DBC alone.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    check = commands.add_parser(
        "check",
        help="judge a log by every rule that a fleet must keep",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    check.add_argument("log", metavar="LOG", help="log as candump -L writes it, or - for standard input")
    check.add_argument("--site", type=Path, metavar="SITE", help="site file; without it some rules are left out")
    check.add_argument("--dbc", type=Path, metavar="FILE", help="DBC of the fleet bus instead of the built-in contract")
    check.add_argument(
        "--faults", action="store_true", help="frames were lost on purpose: leave out rules that need every frame"
    )
    check.add_argument("--json", type=Path, metavar="FILE", help="write the verdict as JSON too")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    args = build_parser().parse_args(argv)
    try:
        site = load_site(args.site) if args.site is not None else None
        codec = _read_codec(args.dbc) if args.dbc is not None else None
        verdict = _check(args.log, checks_for(site, disturbed=args.faults, fleet=codec))
        if args.json is not None:
            _write_json(args.json, verdict)
    except (ConfigError, TraceError) as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"onboard trace: {line}", file=sys.stderr)
        return 2
    try:
        print("\n".join(verdict.lines(lambda node: _name(site, node))))
    except BrokenPipeError:
        return 1
    return 0 if verdict.is_good else 1


def _check(log: str, checks: Checks) -> Verdict:
    with ExitStack() as stack:
        lines: BinaryIO = sys.stdin.buffer
        if log != "-":
            try:
                lines = stack.enter_context(Path(log).open("rb"))
            except OSError as error:
                raise TraceError(f"{log}: cannot be read ({error.strerror}); name an existing log") from error
        verdict = check_records(CandumpReader(lines), checks)
    if not verdict.messages:
        raise TraceError(f"{log}: no message of this contract in it; is it a log as candump -L writes it?")
    return verdict


def _read_codec(path: Path) -> Codec:
    try:
        return Codec(read_layouts(path.read_text(encoding="utf-8-sig")))
    except OSError as error:
        raise TraceError(f"{path}: cannot be read ({error.strerror}); name an existing DBC") from error
    except Exception as error:  # the DBC reader has a dozen errors of its own for a bad text
        why = " ".join(str(error).split())[:200]
        raise TraceError(f"{path}: not a DBC of this contract ({why}); a site's DBC is for other tools") from error


def _write_json(path: Path, verdict: Verdict) -> None:
    try:
        path.write_text(json.dumps(verdict.to_json(), indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise TraceError(f"{path}: cannot be written ({error.strerror}); name another file") from error


def _name(site: Site | None, node: int) -> str:
    machine = site.machines.get(node) if site is not None else None
    return machine.name if machine is not None else f"node {node}"

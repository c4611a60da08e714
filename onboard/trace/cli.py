"""``onboard trace``: look at a log of a bus. Loaded only where it is asked for: no part of a controller."""

import argparse
import gc
import os
import sys
from collections.abc import Callable, Sequence

from onboard.config.arguments import Parser
from onboard.config.problems import ConfigError
from onboard.trace.commands import charts, check, convert, dissector, dump, export, load, replay, story
from onboard.trace.commands.common import Register, TraceError
from onboard.trace.dump.filters import FilterError
from onboard.trace.readers.open_log import LogOpenError

HELP = """\
exit status:
  0  done; for check and replay: nothing was found
  1  check found a broken rule, replay a difference
  2  a mistake in the command line or in a file; one line says where and what to do

examples:
  bus-sim run small --one-car 60 --trace run.log --devices
  onboard trace dump run.log -tz 18000000:1F000000
  onboard trace dump run.log --decode --site bus_sim/sites/small.toml
  onboard trace check run.log --site bus_sim/sites/small.toml
  onboard trace COMMAND --help
"""

#: New objects between two looks for cycles.
_GC_THRESHOLD = 50_000

_COMMANDS: tuple[Register, ...] = (
    dump.register,
    convert.register,
    export.register,
    story.register_calls,
    story.register_why,
    check.register,
    charts.register_sequence,
    charts.register_diagram,
    load.register,
    replay.register,
    dissector.register,
)


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard trace``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard trace",
        description="Look at what was on a bus: from the log and the DBC alone.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for register in _COMMANDS:
        register(commands)
    return parser


def _taken_late(args: argparse.Namespace, words: list[str]) -> bool:
    """Whether words after an option are such as may come last: argparse gives up what it could leave out before one."""
    if any(word.startswith("-") for word in words):
        return False
    match args.command, words:
        case "dump", _:
            args.filters += words
        case "why", [task] if args.task is None:
            args.task = task
        case _:
            return False
    return True


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = build_parser()
    args, late = parser.parse_known_args(argv)
    if late and not _taken_late(args, late):
        parser.error(f"unrecognized arguments: {' '.join(late)}")
    run: Callable[[argparse.Namespace], int] = args.run
    before = gc.get_threshold()
    # Frames and words of them make no cycles: to look for some every few hundred takes a tenth of the time.
    gc.set_threshold(_GC_THRESHOLD)
    try:
        return run(args)
    except ConfigError as error:
        print(error, file=sys.stderr)
    except (TraceError, LogOpenError, FilterError) as error:
        for line in str(error).splitlines():
            print(f"onboard trace: {line}", file=sys.stderr)
    except BrokenPipeError:
        # Whoever read has seen enough. Python would complain again when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        gc.set_threshold(*before)
    return 2

"""What the commands of ``onboard trace`` share: files that a person names, and one clear line where one is wrong."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from onboard.config.site import load_site
from onboard.core.site import Site
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log


class Commands(Protocol):
    """What argparse gives for sub-commands; it has no public name there."""

    def add_parser(
        self,
        name: str,
        *,
        help: str,  # noqa: A002  # argparse's own word
        epilog: str,
        formatter_class: type[argparse.HelpFormatter],
    ) -> argparse.ArgumentParser:
        """A parser for one command."""


#: Adds a command to the parser; what it sets as ``run`` takes the arguments and returns the exit status.
Register = Callable[[Commands], None]


def add_command(
    commands: Commands, name: str, what: str, epilog: str, run: Callable[[argparse.Namespace], int]
) -> argparse.ArgumentParser:
    """A command with its line of help, its examples, and what runs it."""
    parser = commands.add_parser(name, help=what, epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.set_defaults(run=run)
    return parser


class TraceError(ValueError):
    """A person's mistake: one clear line."""


def add_log(parser: argparse.ArgumentParser) -> None:
    """The log that a command reads."""
    parser.add_argument(
        "log", metavar="LOG", help="candump -L, Vector ASC or BLF, PEAK TRC or pcapng file, or - for stdin"
    )


def add_site(parser: argparse.ArgumentParser, *, required: bool = False) -> None:
    """The site whose words are used."""
    parser.add_argument(
        "--site", type=Path, metavar="SITE", required=required, help="site file, or shipped site's name"
    )


def site_of(args: argparse.Namespace) -> Site | None:
    """The site asked for, if any. Raises ``ConfigError``."""
    path: Path | None = args.site
    return load_site(path) if path is not None else None


def open_log(args: argparse.Namespace) -> Log:
    """The log asked for, with a bar on standard error where that is a terminal."""
    name: str = args.log
    return Log(name, bar=sys.stderr)


def tell_faults(log: Log, listener: Listener | None = None) -> None:
    """What was wrong with a log, on standard error."""
    for line in [*log.faults.lines(), *(listener.lines() if listener is not None else [])]:
        print(f"{log.name}: {line}", file=sys.stderr)


def write_text(path: Path, text: str) -> None:
    """Write a file that a person named. Raises ``TraceError``."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise TraceError(f"{path}: cannot be written ({error.strerror}); name another file") from error

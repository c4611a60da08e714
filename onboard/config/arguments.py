"""The parser of every program's command line: one mistake is one line, as in files."""

import argparse
import os
import sys
from typing import Any, NoReturn

#: Width of a help text where nobody knows the terminal's, and what argparse leaves free at its right, in characters.
_COLUMNS, _FREE = 80, 2
#: Digits of the longest whole number that is taken: it fits 64 bits.
_DIGITS = 18
#: Three years: longer than any log.
_LONGEST_S = 100_000_000


def seconds(text: str) -> float:
    """Seconds that an option says, from 0 to ``_LONGEST_S``. Raises what argparse tells as the option's mistake."""
    try:
        found = float(text)
    except ValueError:
        found = -1.0
    if not 0 <= found <= _LONGEST_S:  # not a number is in no range
        raise argparse.ArgumentTypeError(f"{text}: must be seconds from 0 to {_LONGEST_S}")
    return found


def whole(text: str) -> int | None:
    """A whole number that a person typed in digits; None for anything else.

    ``int`` raises for some of what ``isdigit`` takes, such as a raised 2, and for thousands of digits.
    """
    return int(text) if len(text) <= _DIGITS and text.isascii() and text.isdecimal() else None


class Parser(argparse.ArgumentParser):
    """As argparse's, without the usage before each mistake: ``--help`` shows it to those who want it.

    Its sub-commands are parsed alike.
    """

    def error(self, message: str) -> NoReturn:
        """Tell the mistake and where help is, and end with status 2."""
        print(f"{self.prog}: {message}; see {self.prog} --help", file=sys.stderr)
        raise SystemExit(2)

    def _get_formatter(self) -> argparse.HelpFormatter:
        """As argparse's; that one asks shutil for the width at every option, which takes a board 0.7 MB along."""
        made: Any = self.formatter_class
        formatter: argparse.HelpFormatter = made(prog=self.prog, width=_columns() - _FREE)
        return formatter


def _columns() -> int:
    """As ``shutil.get_terminal_size``: what COLUMNS says, else the terminal's own, else 80."""
    told = os.environ.get("COLUMNS", "")
    if told.isdecimal() and int(told) > 0:
        return int(told)
    try:
        return os.get_terminal_size(1).columns or _COLUMNS
    except OSError:
        return _COLUMNS

"""What a bench is given on its command line: by place, each with its default; a mistake is one line, status 2."""

import argparse
import inspect
import sys
from argparse import ArgumentTypeError
from collections.abc import Callable

from bus_sim.sites import find_site
from onboard.config.problems import ConfigError

#: How a word is read, and what counts where it is not there.
Place = tuple[Callable[[str], object], object]


def given(*, rest: str = "", **places: Place) -> argparse.Namespace:
    """The words of the command line, by the names of ``places`` in turn; ``--help`` says what the bench's module says.

    The last of them, where it is ``rest``, may come several times: a list, of its default where it never comes.
    Ends the program with status 2 at a mistake, and with 0 behind ``--help``.
    """
    caller = inspect.currentframe()
    assert caller is not None and caller.f_back is not None
    parser = argparse.ArgumentParser(
        description=caller.f_back.f_globals.get("__doc__"), formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, (read, default) in places.items():
        if name == rest:
            parser.add_argument(name, type=read, nargs="*", default=[default], help=f"default: {default}")
        else:
            parser.add_argument(name, type=read, nargs="?", default=default, help=f"default: {default}")
    return parser.parse_args(sys.argv[1:])


def a_site(text: str) -> str:
    """The name of a shipped site, or a file that is one."""
    try:
        find_site(text)
    except (ValueError, ConfigError) as error:
        raise ArgumentTypeError(str(error)) from error
    return text


def a_count(text: str) -> int:
    """A whole number, 1 or more."""
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f"{text}: must be a whole number, 1 or more")
    return int(text)


def a_number(text: str) -> int:
    """A whole number, 0 or more."""
    if not text.isdecimal():
        raise ArgumentTypeError(f"{text}: must be a whole number, 0 or more")
    return int(text)

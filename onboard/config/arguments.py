"""The parser of every program's command line: one mistake is one line, as in files."""

import argparse
import sys
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """As argparse's, without the usage before each mistake: ``--help`` shows it to those who want it.

    Its sub-commands are parsed alike.
    """

    def error(self, message: str) -> NoReturn:
        """Tell the mistake and where help is, and end with status 2."""
        print(f"{self.prog}: {message}; see {self.prog} --help", file=sys.stderr)
        raise SystemExit(2)

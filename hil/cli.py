"""``python -m hil``: what a person does with one machine. The bench itself is ``pytest hil``."""

import sys
from collections.abc import Sequence

from hil.commission.command import main as commission

_USAGE = """\
usage: python -m hil commission --machine FILE
           walk through a new machine on a live bus; --help tells more
       pytest hil --bench FILE
           every scenario on the devices of a bench; hil/benches/board.toml describes the file
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    words = sys.argv[1:] if argv is None else list(argv)
    if words[:1] == ["commission"]:
        return commission(words[1:])
    if words[:1] in (["-h"], ["--help"]):
        print(_USAGE, end="")
        return 0
    mistake = f'"{words[0]}" is no command' if words else "a command is missing"
    print(f"python -m hil: {mistake}; write commission, or see python -m hil --help", file=sys.stderr)
    return 2

"""``python -m bus_sim``, and the command ``bus-sim``."""

import sys

from onboard.entry import Interruptible


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    with Interruptible("bus-sim"):
        from bus_sim.cli import main as command_line  # noqa: PLC0415  # importing is what may be interrupted

        return command_line(argv)


if __name__ == "__main__":
    sys.exit(main())

"""``python -m deploy``."""

import sys

from onboard.entry import Interruptible


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    with Interruptible("python -m deploy"):
        from deploy.cli import main as command_line  # noqa: PLC0415  # importing is what may be interrupted

        return command_line(argv)


if __name__ == "__main__":
    sys.exit(main())

"""``python -m onboard``, and the command ``onboard``."""

import sys

from onboard.entry import Interruptible, spare_openssl


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    with Interruptible("onboard"):
        words = sys.argv[1:] if argv is None else argv
        if words and words[0].startswith("-") and not any(word.startswith("--mqtt") for word in words):
            spare_openssl()
        from onboard.cli import main as command_line  # noqa: PLC0415  # importing is what may be interrupted

        return command_line(argv)


if __name__ == "__main__":
    sys.exit(main())

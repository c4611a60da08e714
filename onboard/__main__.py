"""``python -m onboard``, and the command ``onboard``."""

import sys

from onboard.entry import Interruptible, spare_openssl


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    with Interruptible("onboard"):
        words = sys.argv[1:] if argv is None else argv
        if words and words[0].startswith("-") and not any(word.startswith("--mqtt") for word in words):
            spare_openssl()
        if words[:1] == ["trace"]:
            # Nothing of a controller is loaded to look at logs.
            from onboard.io.signals import terminated_as_interrupted  # noqa: PLC0415  # as below
            from onboard.trace.cli import main as trace  # noqa: PLC0415  # as below

            with terminated_as_interrupted():
                return trace(words[1:])
        from onboard.cli import main as command_line  # noqa: PLC0415  # importing is what may be interrupted

        return command_line(argv)


if __name__ == "__main__":
    sys.exit(main())

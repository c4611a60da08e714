"""The first second of every program, in which its modules are imported: Ctrl-C is no accident then either.

Imports nothing that an interpreter has not loaded by itself, so that there is hardly a moment before it.
"""

import sys

#: Exit status of a program that a person ended: 128 and the number of SIGINT, as shells have it.
INTERRUPTED = 130


class Interruptible:
    """A context in which Ctrl-C that nobody further in has taken is one line, and ends it (``INTERRUPTED``)."""

    def __init__(self, program: str) -> None:
        """``program`` as a person calls it."""
        self._program = program

    def __enter__(self) -> None:
        """Nothing is set up: an exception is all that is looked at."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if kind is KeyboardInterrupt:
            print(f"{self._program}: interrupted", file=sys.stderr)
            raise SystemExit(INTERRUPTED) from None

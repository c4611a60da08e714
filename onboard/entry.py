"""The first second of every program, in which its modules are imported: Ctrl-C is no accident then either.

Imports nothing that an interpreter has not loaded by itself, so that there is hardly a moment before it.
"""

import sys

#: Hash functions of the interpreter's own; without them ``hashlib`` has those of OpenSSL only.
_OWN_HASHES = frozenset({"_sha2", "_sha256"})
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


def spare_openssl() -> None:
    """Load asyncio and ``hashlib`` without OpenSSL: 1.7 MB that a controller without a broker never uses.

    Both do without where it cannot be imported, as the library reference says of ``ssl``; whoever imports it later has
    it, but asyncio's own TLS. Nothing happens where they are loaded, or the interpreter has no hash functions.
    """
    absent = ["ssl"] if sys.modules.keys().isdisjoint(("asyncio", "ssl")) else []
    if "hashlib" not in sys.modules and not _OWN_HASHES.isdisjoint(sys.builtin_module_names):
        absent.append("_hashlib")
    for name in absent:
        sys.modules[name] = None  # type: ignore[assignment]  # how an import is told that there is no such module
    try:
        import asyncio  # noqa: PLC0415, F401  # to be loaded is all
        import hashlib  # noqa: PLC0415, F401  # as above
        import hmac  # noqa: PLC0415, F401  # as above
    finally:
        for name in absent:
            del sys.modules[name]

"""Files from outside, read whole but never without a bound: of length, and of patience with what is no file.

Whatever is parsed afterwards is bounded so before its parser sees it. Every failure is an ``OSError`` whose
``strerror`` says why in words, so that who reads a file tells of a device as of a file that is not there.
"""

import errno
import os
import select
import stat
import time
from pathlib import Path

#: Longest text that a person writes, bytes: a site file of the largest size that is drawn here has a tenth of it.
MOST_TEXT = 4_000_000
#: What a tool exports: maps of others, tables of sessions. Longest file that is held whole and parsed within seconds.
MOST_EXPORT = 32_000_000
#: A pipe that has not come to its end in this time is given up, s: another program writes it in a moment.
PATIENCE_S = 5.0
_PIECE = 1 << 16


def read_bounded(path: Path, most_bytes: int = MOST_TEXT) -> bytes:
    """The whole of a file, or of a pipe that ends. Raises ``OSError`` for what is longer, or does not end in time.

    A ``ValueError`` comes for a null character in the path.
    """
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if stat.S_ISREG(os.fstat(file).st_mode) and os.fstat(file).st_size > most_bytes:
            raise _too_long(most_bytes)
        return _whole(file, most_bytes)
    finally:
        os.close(file)


def is_there(path: Path) -> bool:
    """Whether something has this name; no where that cannot be said: too long a name, a folder that is another's."""
    try:
        return path.exists()
    except OSError:
        return False


def is_folder(path: Path) -> bool:
    """Whether it is a folder, likewise."""
    return is_there(path) and path.is_dir()


def _whole(file: int, most_bytes: int) -> bytes:
    until_s, pieces, length = time.monotonic() + PATIENCE_S, [b""], 0
    while length <= most_bytes:
        if not select.select([file], [], [], max(0.0, until_s - time.monotonic()))[0]:
            raise TimeoutError(errno.ETIMEDOUT, f"does not come to its end within {PATIENCE_S:g} s")
        piece = os.read(file, _PIECE)
        if not piece:
            return b"".join(pieces)
        pieces.append(piece)
        length += len(piece)
    raise _too_long(most_bytes)


def _too_long(most_bytes: int) -> OSError:
    return OSError(errno.EFBIG, f"is longer than {most_bytes / 1e6:g} MB")

"""A small file that only its owner may read: words and secrets that give somebody a right."""

import os
import stat
from pathlib import Path


class OwnedFileError(Exception):
    """A file that cannot be used; ``str`` is one line: file, what is wrong, what to do. It quotes nothing of it."""


def make_owned(path: Path, line: str) -> None:
    """Write one line of ASCII, mode 0600; durable when this returns. Raises ``FileExistsError`` and ``OSError``."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
        file.write(f"{line}\n")
        file.flush()
        os.fsync(file.fileno())
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def read_owned(path: Path, most_bytes: int, instead: str) -> list[str]:
    """Lines of its first ``most_bytes``; ``instead``: the remedy where it is no file. Raises ``OwnedFileError``."""
    try:
        # Without waiting: a pipe that nobody writes into is no file.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            state = os.fstat(file.fileno())
            if not stat.S_ISREG(state.st_mode):
                raise OwnedFileError(f"{path}: is not a file; {instead}")
            if state.st_mode & 0o077:
                raise OwnedFileError(f"{path}: others may read it; chmod 600 {path}")
            return file.read(most_bytes).decode("ascii", "replace").splitlines()
    except OSError as error:
        raise OwnedFileError(f"{path}: {error.strerror or error}; name a file that can be read") from error

"""The word that a server wants to hear before it serves anybody: kept in a file that only its owner reads."""

import os
import re
import secrets
import stat
from pathlib import Path

#: Bytes of chance in a word that is made here: 128 bits, which nobody guesses over a network.
_CHANCE = 16
_WORD = re.compile(r"[A-Za-z0-9_-]{16,128}")
_MOST_BYTES = 1_024


class TokenFileError(Exception):
    """A file of such a word that cannot be used; ``str`` is one line: file, what is wrong, what to do."""


def kept_token(path: Path) -> str:
    """The word in a file; where there is no file it is made, mode 0600. Raises ``TokenFileError``."""
    try:
        return _made(path)
    except FileExistsError:
        return _read(path)
    except OSError as error:
        raise TokenFileError(f"{path}: {error.strerror or error}; name a file in a folder of your own") from error


def read_token(path: Path) -> str:
    """The word in a file that a server has made. Raises ``TokenFileError``."""
    if not path.exists():
        raise TokenFileError(f"{path}: does not exist; name the file that the server was given")
    return _read(path)


def _made(path: Path) -> str:
    word = secrets.token_urlsafe(_CHANCE)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
        file.write(f"{word}\n")
    return word


def _read(path: Path) -> str:
    try:
        # Without waiting: a pipe that nobody writes into is no file with a word.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            state = os.fstat(file.fileno())
            if not stat.S_ISREG(state.st_mode):
                raise TokenFileError(f"{path}: is not a file; name a file whose first line is the token")
            if state.st_mode & 0o077:
                raise TokenFileError(f"{path}: others may read it; chmod 600 {path}")
            first = file.read(_MOST_BYTES).split(b"\n")[0].decode("ascii", "replace").strip()
    except OSError as error:
        raise TokenFileError(f"{path}: {error.strerror or error}; name a file that can be read") from error
    if _WORD.fullmatch(first) is None:
        raise TokenFileError(f"{path}: no token; its first line needs 16 to 128 of letters, digits, - and _")
    return first

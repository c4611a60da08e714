"""The word that a server wants to hear before it serves anybody: kept in a file that only its owner reads."""

import re
import secrets
from pathlib import Path

from onboard.bounded_file import is_there
from onboard.io.owned_file import OwnedFileError, make_owned, read_owned

#: Bytes of chance in a word that is made here: 128 bits, which nobody guesses over a network.
_CHANCE = 16
_WORD = re.compile(r"[A-Za-z0-9_-]{16,128}")
_MOST_BYTES = 1_024


def kept_token(path: Path) -> str:
    """The word in a file; where there is no file it is made, mode 0600. Raises ``OwnedFileError``."""
    try:
        return _made(path)
    except FileExistsError:
        return _read(path)
    except OSError as error:
        raise OwnedFileError(f"{path}: {error.strerror or error}; name a file in a folder of your own") from error


def read_token(path: Path) -> str:
    """The word in a file that a server has made. Raises ``OwnedFileError``."""
    if not is_there(path):
        raise OwnedFileError(f"{path}: does not exist; name the file that the server was given")
    return _read(path)


def _made(path: Path) -> str:
    word = secrets.token_urlsafe(_CHANCE)
    make_owned(path, word)
    return word


def _read(path: Path) -> str:
    lines = read_owned(path, _MOST_BYTES, "name a file whose first line is the token")
    first = lines[0].strip() if lines else ""
    if _WORD.fullmatch(first) is None:
        raise OwnedFileError(f"{path}: no token; its first line needs 16 to 128 of letters, digits, - and _")
    return first

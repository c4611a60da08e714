"""What machines of a kind know and nobody else of their site: kept beside the journal, in a file only its owner reads.

One line of 64 hexadecimal digits each, the newest first; lines with # are for people.
"""

import re
import secrets
from pathlib import Path
from typing import NamedTuple

from onboard.io.owned_file import OwnedFileError, make_owned, read_owned

#: 256 bits: the longest key of BLAKE2s.
SECRET_BYTES = 32
#: The newest, and the one before it: what was made under that still counts.
MOST_SECRETS = 2
_LINE = re.compile(rf"[0-9a-f]{{{2 * SECRET_BYTES}}}")
_MOST_BYTES = 4_096


class KeptSecrets(NamedTuple):
    """What a machine has, 32 bytes each, the newest first; ``is_new`` where it was made just now."""

    secrets: tuple[bytes, ...]
    is_new: bool


def secrets_path(journal: Path) -> Path:
    """Where they are: beside the journal's folder, and so on its partition."""
    return journal.with_name(f"{journal.name}.tickets")


def kept_secrets(path: Path) -> KeptSecrets:
    """The secrets in a file; without a file one is drawn, and is durable. Raises ``OwnedFileError``."""
    try:
        return KeptSecrets((_made(path),), is_new=True)
    except FileExistsError:
        return KeptSecrets(_read(path), is_new=False)
    except OSError as error:
        raise OwnedFileError(f"{path}: {error.strerror or error}; name another folder with --journal") from error


def _made(path: Path) -> bytes:
    path.parent.mkdir(parents=True, exist_ok=True)
    secret = secrets.token_bytes(SECRET_BYTES)
    make_owned(path, secret.hex())
    return secret


def _read(path: Path) -> tuple[bytes, ...]:
    told = read_owned(path, _MOST_BYTES, "put the desks' file there, or move it away")
    lines = [line.strip() for line in told]
    lines = [line for line in lines if line and not line.startswith("#")]
    if not 1 <= len(lines) <= MOST_SECRETS or not all(_LINE.fullmatch(line) for line in lines):
        digits = 2 * SECRET_BYTES
        what = f"is not one line of {digits} hexadecimal digits, or two"
        raise OwnedFileError(f"{path}: {what}; write it again with onboard keys tickets, or move it away")
    return tuple(bytes.fromhex(line) for line in lines)

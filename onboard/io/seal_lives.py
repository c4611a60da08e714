"""How often a node began to seal: a number that outlives it, so that none of its seals has a number twice."""

import os
from pathlib import Path

_MOST = (1 << 32) - 1


class SealLivesError(Exception):
    """The file cannot be trusted; ``str`` is one line for a person."""


def next_life(beside: Path, made: int) -> int:
    """The number of the life that begins, on the disk before this returns; above ``made``, when its keys were written.

    It is kept ``beside`` the journal's folder, or a tool's key file, in NAME.lives.
    Raises ``OSError``, and ``SealLivesError`` where the file holds no number: with an older one, recorded words of a
    former life would count again.
    """
    path = beside.with_name(f"{beside.name}.lives")
    try:
        text = path.read_bytes()[:32].decode("ascii", "replace").strip()
    except FileNotFoundError:
        text = "0"
    if not text.isascii() or not text.isdecimal() or int(text) >= _MOST:
        raise SealLivesError(f"{path}: holds no number of a life; delete it, and give the machine newly written keys")
    life = max(int(text), made) + 1
    fresh = path.with_name(f"{path.name}.new")
    with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="ascii") as file:
        file.write(f"{life}\n")
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return life

"""The folder of a site's keys, on the computer of whoever commissions it."""

import os
import secrets
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from onboard.config.keys import key_text
from onboard.core.site import Site
from onboard.keys.agreement import KeysError, fingerprint, new_identity, pair_key, public_of
from onboard.seal.keys import KEY_BYTES, Keys

#: What tells a checkout's topmost folder.
_MARKS = (".git", ".hg", ".svn", ".jj")


@dataclass(frozen=True, slots=True)
class MadeKeys:
    """One node's row for a person: its name, number and fingerprint, and the file for its board."""

    name: str
    node: int
    fingerprint: str
    file: Path


class KeyFolder:
    """``NAME.pem`` is the secret identity of each node, ``group`` the site's key, ``NAME.keys`` what a board gets.

    Every file has mode 0600. Every method raises ``KeysError`` and ``OSError``.
    """

    def __init__(self, folder: Path, site: Site, tools: Collection[int]) -> None:
        """``tools``: node-IDs 251 to 255 of people's tools that get keys."""
        self._folder, self._site = folder, site
        names = {node: machine.name for node, machine in site.machines.items()}
        self._names = names | {tool: f"tool-{tool}" for tool in sorted(tools)}
        refuse_checkout(folder)

    def renew(self, names: Collection[str]) -> None:
        """Forget the identities of these nodes, and the group key, which they knew too."""
        unknown = sorted(set(names) - set(self._names.values()))
        if unknown:
            raise KeysError(f"{unknown[0]}: no such machine; there are {', '.join(self._names.values())}")
        for name in names:
            (self._folder / f"{name}.pem").unlink(missing_ok=True)
        (self._folder / "group").unlink(missing_ok=True)

    def write(self, now_s: int) -> list[MadeKeys]:
        """Make what is missing, and write every board's file anew; ``now_s`` is Unix time."""
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        group = self._kept("group", lambda: secrets.token_hex(KEY_BYTES).encode())
        for name in self._names.values():
            self._kept(f"{name}.pem", new_identity)
        public = {node: public_of(self._folder / f"{name}.pem") for node, name in self._names.items()}
        pairs = self._pairs(public)
        made = []
        for node, name in self._names.items():
            own = {other: pairs[min(node, other), max(node, other)] for other in self._names if other != node}
            keys = Keys(node, bytes.fromhex(group.decode()), own, now_s)
            file, print_ = self._folder / f"{name}.keys", fingerprint(public[node])
            write_private(file, key_text(keys, self._site.name, name, print_).encode())
            made.append(MadeKeys(name, node, print_, file))
        return made

    def _pairs(self, public: Mapping[int, bytes]) -> dict[tuple[int, int], bytes]:
        return {
            (one, other): pair_key(
                self._folder / f"{self._names[one]}.pem", (one, public[one]), (other, public[other]), self._site.name
            )
            for one in self._names
            for other in self._names
            if one < other
        }

    def _kept(self, name: str, make: Callable[[], bytes]) -> bytes:
        path = self._folder / name
        if not path.exists():
            write_private(path, make())
        return path.read_bytes().strip()


def write_private(path: Path, content: bytes) -> None:
    """A file of mode 0600, whole or as it was. Raises ``OSError``."""
    fresh = path.with_name(f"{path.name}.new")
    with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file:
        file.write(content)
    fresh.replace(path)


def refuse_checkout(folder: Path) -> None:
    """Raises ``KeysError`` for a folder from which keys would get into somebody's commits."""
    whole = folder.resolve()
    checkout = next((one for one in (whole, *whole.parents) if any((one / mark).exists() for mark in _MARKS)), None)
    if checkout is not None:
        raise KeysError(f"{folder}: is inside the checkout {checkout}; name a folder outside with --folder")

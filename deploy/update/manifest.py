"""What an update file says of itself: for which board and site, which version, and the digest of each of its parts."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime
from typing import Any

#: Every 64-bit ARM board takes the same image.
BOARD = "arm64"
FORMAT = 1
#: What an update brings: the kernel with its first file system, and the root file system.
KERNEL, INITRD, ROOT = PARTS = ("vmlinuz", "initrd", "root.squashfs")
_VERSION = re.compile(r"[0-9]{1,6}(\.[0-9]{1,6}){0,3}")
_DIGEST = re.compile(r"[0-9a-f]{64}")


class UpdateError(Exception):
    """An update is not taken, or cannot be made; ``str`` is one line for a person."""


@dataclass(frozen=True, slots=True)
class Content:
    """One part of an update: its length and its SHA-256 in hex."""

    size_bytes: int
    digest: str


@dataclass(frozen=True, slots=True)
class Manifest:
    """An update; ``site`` is the site that it is for, "" for any. After the day ``expires`` nobody takes it."""

    version: str
    board: str
    site: str
    expires: date
    parts: Mapping[str, Content]


@dataclass(frozen=True, slots=True)
class Running:
    """The system that judges an update: what runs, and which version was given up here before ("" for none).

    ``today`` is what its clock says.
    """

    version: str
    board: str
    site: str
    today: date
    failed: str = ""


def today() -> date:
    """The day in UTC by this computer's clock."""
    return datetime.now(UTC).date()


def version_key(version: str) -> tuple[int, ...]:
    """What versions are ordered by: numbers, and 1.2 is older than 1.2.0. Raises ``UpdateError``."""
    if not _VERSION.fullmatch(version):
        raise UpdateError(f"{version!r}: a version is up to four numbers with dots between them, as 0.1.2")
    return tuple(int(number) for number in version.split("."))


def to_bytes(manifest: Manifest) -> bytes:
    """The bytes that are signed: JSON with sorted keys."""
    parts = {name: {"bytes": part.size_bytes, "sha256": part.digest} for name, part in manifest.parts.items()}
    said = {
        "format": FORMAT,
        "version": manifest.version,
        "board": manifest.board,
        "site": manifest.site,
        "expires": manifest.expires.isoformat(),
        "parts": parts,
    }
    return (json.dumps(said, sort_keys=True, indent=1) + "\n").encode()


def from_bytes(said: bytes) -> Manifest:
    """Read what was signed. Raises ``UpdateError`` for what is not a manifest of this format."""
    try:
        read = json.loads(said)
        return _checked(read)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise UpdateError("its manifest cannot be read; make the update anew") from None


def _checked(read: Any) -> Manifest:
    if read["format"] != FORMAT:
        raise UpdateError(f"its format is {read['format']}, and this system reads format {FORMAT}; update step by step")
    parts = {name: Content(int(part["bytes"]), str(part["sha256"])) for name, part in read["parts"].items()}
    if set(parts) != set(PARTS) or not all(
        _DIGEST.fullmatch(part.digest) and part.size_bytes > 0 for part in parts.values()
    ):
        raise ValueError(parts)
    version_key(str(read["version"]))
    expires = date.fromisoformat(read["expires"])
    return Manifest(str(read["version"]), str(read["board"]), str(read["site"]), expires, parts)


def refusal(manifest: Manifest, running: Running) -> str | None:
    """Why this system does not take an update that is whole and rightly signed, or None."""
    if manifest.board != running.board:
        return f"it is for {manifest.board} boards, and this is one of {running.board}"
    if manifest.site and manifest.site != running.site:
        return f"it is for site {manifest.site}, and this machine's is {running.site or 'not known'}"
    if running.today > manifest.expires:
        return f"it was to be taken until {manifest.expires}, and the clock here says {running.today}; make it anew"
    if version_key(manifest.version) == version_key(running.version):
        return f"version {manifest.version} runs already"
    if version_key(manifest.version) < version_key(running.version):
        return f"version {manifest.version} is older than {running.version}, which runs"
    if manifest.version == running.failed:
        return f"version {manifest.version} was given up here before; make a newer one"
    return None

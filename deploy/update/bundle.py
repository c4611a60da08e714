"""An update as one file: a tar archive of manifest, signature and parts, in this order, and of nothing else.

Whoever can plug a stick in can have it read, before any signature is known to be good: so it is not unpacked, and only
heads of the form that is written here count, none that would have a reader hold or unfold what stands behind it.
"""

import contextlib
import hashlib
import io
import tarfile
from collections.abc import Iterator, Mapping
from datetime import date, timedelta
from pathlib import Path
from typing import Self

from deploy.update.manifest import (
    BOARD,
    PARTS,
    Content,
    Manifest,
    UpdateError,
    from_bytes,
    to_bytes,
    today,
    version_key,
)
from deploy.update.signature import SIGNATURE_BYTES, is_signed, sign

#: So long an update is taken where nothing else is said: time to go round a site, not to lie about for years.
LIFE = timedelta(days=90)
MANIFEST, SIGNATURE = "manifest.json", "manifest.sig"
#: No manifest of ours comes near; a file that says otherwise is not ours.
_MANIFEST_LIMIT = 65_536
_BLOCK = 1 << 20


def write_bundle(
    to: Path, parts: Mapping[str, Path], secret: Path, version: str, site: str = "", expires: date | None = None
) -> Manifest:
    """Write an update from its parts' files; it ``expires`` ``LIFE`` from now unless told. May raise ``UpdateError``.

    ``OSError`` as well.
    """
    version_key(version)
    contents = {name: _content(parts[name]) for name in PARTS}
    manifest = Manifest(version, BOARD, site, expires or today() + LIFE, contents)
    said = to_bytes(manifest)
    with tarfile.open(to, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in ((MANIFEST, said), (SIGNATURE, sign(said, secret))):
            archive.addfile(_entry(name, len(content)), io.BytesIO(content))
        for name in PARTS:
            with parts[name].open("rb") as file:
                archive.addfile(_entry(name, contents[name].size_bytes), file)
    return manifest


def _entry(name: str, size: int) -> tarfile.TarInfo:
    entry = tarfile.TarInfo(name)
    entry.size = size
    return entry


def _content(file: Path) -> Content:
    with file.open("rb") as content:
        return Content(file.stat().st_size, hashlib.file_digest(content, "sha256").hexdigest())


class Bundle:
    """An update file that is read. Whatever is wrong with it raises ``UpdateError``, from the first line on."""

    def __init__(self, file: Path, public: Path) -> None:
        """Read the manifest, and believe nothing of it before its signature is the key's owner's."""
        if not file.is_file():
            raise UpdateError("it is not a file; name an update file")
        self._file = file.open("rb")
        with contextlib.ExitStack() as on_failure:
            on_failure.callback(self._file.close)
            self._places = dict(self._heads())
            if MANIFEST not in self._places:
                raise UpdateError("it is not an update file, or not a whole one")
            said, signature = self._read(MANIFEST), self._read(SIGNATURE)
            if len(signature) != SIGNATURE_BYTES or not is_signed(said, signature, public):
                raise UpdateError("it is not signed with a key that this system trusts")
            self.manifest = from_bytes(said)
            on_failure.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def check(self) -> None:
        """Read every part to its end, against its digest."""
        for name in PARTS:
            for _ in self.blocks(name):
                pass

    def blocks(self, name: str) -> Iterator[bytes]:
        """A part's bytes; raises at its end where they are not those of the manifest."""
        wanted, digest = self.manifest.parts[name], hashlib.sha256()
        place, left = self._place(name)
        is_whole = left == wanted.size_bytes
        self._file.seek(place)
        while left and (block := self._file.read(min(left, _BLOCK))):
            digest.update(block)
            left -= len(block)
            yield block
        if not is_whole or digest.hexdigest() != wanted.digest:
            raise UpdateError(f"{name} in it is torn or was changed; copy the update file again")

    def _read(self, name: str) -> bytes:
        place, size = self._place(name)
        if size > _MANIFEST_LIMIT:
            raise UpdateError("it is not an update file")
        self._file.seek(place)
        return self._file.read(size)

    def _place(self, name: str) -> tuple[int, int]:
        if name not in self._places:
            raise UpdateError(f"it has no {name}; it is not an update file, or not a whole one")
        return self._places[name]

    def _heads(self) -> Iterator[tuple[str, tuple[int, int]]]:
        """Where the content of each part begins, and its length, up to the first that is not as it was written."""
        at = 0
        for name in (MANIFEST, SIGNATURE, *PARTS):
            self._file.seek(at)
            try:
                entry = tarfile.TarInfo.frombuf(self._file.read(tarfile.BLOCKSIZE), "ascii", "replace")
            except tarfile.TarError:
                return
            if (entry.name, entry.type) != (name, tarfile.REGTYPE) or entry.size < 0:
                return
            yield name, (at + tarfile.BLOCKSIZE, entry.size)
            at += tarfile.BLOCKSIZE * (1 + -(-entry.size // tarfile.BLOCKSIZE))

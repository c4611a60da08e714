"""An update as one file: a tar archive of manifest, signature and parts, in this order, read as a stream of bytes."""

import contextlib
import hashlib
import io
import tarfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Self

from deploy.update.manifest import BOARD, PARTS, Content, Manifest, UpdateError, from_bytes, to_bytes, version_key
from deploy.update.signature import SIGNATURE_BYTES, is_signed, sign

MANIFEST, SIGNATURE = "manifest.json", "manifest.sig"
#: No manifest of ours comes near; a file that says otherwise is not ours.
_MANIFEST_LIMIT = 65_536
_BLOCK = 1 << 20


def write_bundle(to: Path, parts: Mapping[str, Path], secret: Path, version: str, site: str = "") -> Manifest:
    """Write an update from its parts' files. Raises ``UpdateError``, ``OSError``."""
    version_key(version)
    contents = {name: _content(parts[name]) for name in PARTS}
    manifest = Manifest(version, BOARD, site, contents)
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
        try:
            self._archive = tarfile.open(file)  # noqa: SIM115  # closed by __exit__; opening reads the first entry
        except (tarfile.TarError, EOFError):
            raise UpdateError("it is not an update file, or not a whole one") from None
        with contextlib.ExitStack() as on_failure:
            on_failure.callback(self._archive.close)
            said, signature = self._read(MANIFEST), self._read(SIGNATURE)
            if len(signature) != SIGNATURE_BYTES or not is_signed(said, signature, public):
                raise UpdateError("it is not signed with the key that this system trusts")
            self.manifest = from_bytes(said)
            on_failure.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def check(self) -> None:
        """Read every part to its end, against its digest."""
        for name in PARTS:
            for _ in self.blocks(name):
                pass

    def blocks(self, name: str) -> Iterator[bytes]:
        """A part's bytes; raises at its end where they are not those of the manifest."""
        wanted, digest, length = self.manifest.parts[name], hashlib.sha256(), 0
        with self._open(name) as content:
            while block := _some(content):
                digest.update(block)
                length += len(block)
                yield block
        if length != wanted.size_bytes or digest.hexdigest() != wanted.digest:
            raise UpdateError(f"{name} in it is torn or was changed; copy the update file again")

    def _read(self, name: str) -> bytes:
        with self._open(name) as content:
            said = content.read(_MANIFEST_LIMIT + 1)
        if len(said) > _MANIFEST_LIMIT:
            raise UpdateError("it is not an update file")
        return said

    def _open(self, name: str) -> IO[bytes]:
        try:
            found = self._archive.extractfile(name)
        except (KeyError, tarfile.TarError, EOFError):
            found = None
        if found is None:
            raise UpdateError(f"it has no {name}; it is not an update file, or not a whole one")
        return found


def _some(content: IO[bytes]) -> bytes:
    try:
        return content.read(_BLOCK)
    except (tarfile.TarError, EOFError):
        return b""

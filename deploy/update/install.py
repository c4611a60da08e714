"""Write an update into the slot that does not run. Until all of it is known to be right, nothing is written."""

import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path

from deploy.update.board import BoardFiles
from deploy.update.bundle import Bundle
from deploy.update.manifest import INITRD, KERNEL, ROOT, Content, Manifest, UpdateError, refusal
from deploy.update.slots import BoardEvent, after, other

_BLOCK = 1 << 20


def install(file: Path, place: BoardFiles, tell: Callable[[str], None]) -> Manifest:
    """Check an update file, write it, and have the boot loader try it at the next start; ``tell`` a person of it.

    Raises ``UpdateError``, before the first byte is written where anything is wrong with the file.
    """
    state = place.state()
    if place.running != state.good:
        raise UpdateError("the system that runs is itself on trial; wait until it has told that it is healthy")
    if not place.key.stat().st_size:
        raise UpdateError("this image was built without a key, so it takes no updates; flash the card anew")
    with Bundle(file, place.key) as bundle:
        why = refusal(bundle.manifest, place.itself())
        if why is not None:
            raise UpdateError(why)
        bundle.check()
        tell(f"version {bundle.manifest.version} is in order; writing it into slot {other(state.good)}")
        _write(bundle, place)
        return bundle.manifest


def _write(bundle: Bundle, place: BoardFiles) -> None:
    state = place.state()
    slot = other(state.good)
    device, root = place.devices[slot], bundle.manifest.parts[ROOT]
    if root.size_bytes > _size(device):
        raise UpdateError(f"its root file system has {root.size_bytes} bytes, and slot {slot} takes {_size(device)}")
    with place.writable():
        begun = after(state, BoardEvent.BEGUN)
        place.keep(begun)
        _overwrite(device, bundle.blocks(ROOT))
        _check(device, root)
        for name in (KERNEL, INITRD):
            _replace(place.boot / slot / name, bundle.blocks(name))
            _check(place.boot / slot / name, bundle.manifest.parts[name])
        place.keep(after(begun, BoardEvent.INSTALLED, bundle.manifest.version))


def _size(device: Path) -> int:
    descriptor = os.open(device, os.O_RDONLY)
    try:
        return os.lseek(descriptor, 0, os.SEEK_END)
    finally:
        os.close(descriptor)


def _overwrite(device: Path, blocks: Iterable[bytes]) -> None:
    descriptor = os.open(device, os.O_WRONLY)
    try:
        for block in blocks:
            _write_all(descriptor, block)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _replace(file: Path, blocks: Iterable[bytes]) -> None:
    """The old kernel goes first, for the partition need not take three; the slot is not to be started just now."""
    file.parent.mkdir(exist_ok=True)
    file.unlink(missing_ok=True)
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    try:
        for block in blocks:
            _write_all(descriptor, block)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_all(descriptor: int, block: bytes) -> None:
    while block:
        block = block[os.write(descriptor, block) :]


def _check(file: Path, wanted: Content) -> None:
    """What the medium gives back, not what the kernel still remembers."""
    descriptor, digest, left = os.open(file, os.O_RDONLY), hashlib.sha256(), wanted.size_bytes
    try:
        os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)
        while left and (block := os.read(descriptor, min(left, _BLOCK))):
            digest.update(block)
            left -= len(block)
    finally:
        os.close(descriptor)
    if digest.hexdigest() != wanted.digest:
        raise UpdateError(f"{file} does not give back what was written; the medium has failed, so replace it")

"""What a computer needs to build images and updates, told all at once."""

import os
import shutil
from collections.abc import Collection
from pathlib import Path

from deploy.wheels import DeployError

#: Programs that are called while an image is built, and the Debian packages that have them.
PACKAGES = {
    "apt-get": "apt",
    "dpkg-deb": "dpkg",
    "tar": "tar",
    "depmod": "kmod",
    "mksquashfs": "squashfs-tools",
    "unsquashfs": "squashfs-tools",
    "mkfs.vfat": "dosfstools",
    "mkfs.ext4": "e2fsprogs",
    "mcopy": "mtools",
    "dtc": "device-tree-compiler",
    "fdtoverlay": "device-tree-compiler",
    "fdtget": "device-tree-compiler",
    "fdtput": "device-tree-compiler",
    "openssl": "openssl",
}
#: What making Debian's root file system takes beside these, once; it is kept.
BASE_PACKAGES = {
    "mmdebstrap": "mmdebstrap",
    "arch-test": "arch-test",
    "qemu-aarch64-static": "qemu-user-static",
    "update-binfmts": "binfmt-support",
}
#: Measured while an image is built: root file system as folder, archive, squashfs and read back, then the disk.
ROOM_MB = 1_000
_PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"


def check_needs(base: Path, *, is_root: bool) -> None:
    """Raise ``DeployError`` with everything that is missing. ``base`` is Debian's root file system, once it is made."""
    wanted = PACKAGES if base.exists() else {**PACKAGES, **BASE_PACKAGES}
    missing = missing_of(wanted)
    remedies = []
    if missing:
        remedies.append(f"apt-get install {' '.join(missing)}")
    if not base.exists() and not is_root:
        remedies.append("run this as root, with sudo: mmdebstrap makes the root file system")
    if remedies:
        raise DeployError(f"this computer cannot build an image yet: {'; '.join(remedies)}")


def check_room(folder: Path, free_mb: int | None = None) -> None:
    """Raise ``DeployError`` where a folder's disk has no room for what a build writes.

    A tool that meets the end of the disk names neither the disk nor the remedy. ``free_mb`` is what is free, instead
    of asking the system.
    """
    there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    free_mb = shutil.disk_usage(there).free >> 20 if free_mb is None else free_mb
    if free_mb < ROOM_MB:
        raise DeployError(f"{folder}: {free_mb} MB are free, a build takes up to {ROOM_MB} MB; free some, or use --out")


def missing_of(wanted: dict[str, str], there: Collection[str] | None = None) -> list[str]:
    """The packages of all programs that are not installed; ``there`` is what is, instead of asking the system."""
    gone = [
        package
        for program, package in wanted.items()
        if (shutil.which(program, path=_PATH) is None if there is None else program not in there)
    ]
    return sorted(set(gone))

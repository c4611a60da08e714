"""The image that people flash: boot partition, root slots A and B, journal. Same inputs, same bytes."""

import hashlib
import shutil
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from deploy.image.apt import run_tool
from deploy.image.boot import BOOT_MB, boot_files, make_fat
from deploy.image.debian import EPOCH_S, STORE, fetch_debian
from deploy.image.disk import FAT32_LBA, LINUX, DiskPartition, write_disk
from deploy.image.release import Release
from deploy.image.root import Root, build_root
from deploy.update.bundle import write_bundle
from deploy.update.manifest import INITRD, KERNEL, ROOT, version_key
from deploy.update.signature import public_key

SLOT_MB = 192
JOURNAL_MB = 64
#: Any constants: numbers drawn at random would make every image another.
_JOURNAL_ID = "0b0a2d01-0000-4000-8000-000000000001"


@dataclass(frozen=True, slots=True)
class Image:
    """The image's file with its SHA-256, and the root file system in its slot A."""

    disk: Path
    digest: str
    root: Root


def build_image(to: Path, release: Release, store: Path = STORE, pi_firmware: Path | None = None) -> Image:
    """Write the image, and beside it, in a folder, what it was made from. Raises ``DeployError``, ``OSError``."""
    parts = to.with_suffix("")
    root = build_root(parts, release, store)
    boot = boot_files(fetch_debian(store), root, parts / "boot", pi_firmware)
    partition = make_fat(parts / "boot.img", sorted(boot.iterdir()))
    journal = make_journal_partition(parts / "journal.img")
    slots = [DiskPartition(LINUX, SLOT_MB, root.squashfs), DiskPartition(LINUX, SLOT_MB)]
    write_disk([DiskPartition(FAT32_LBA, BOOT_MB, partition), *slots, DiskPartition(LINUX, JOURNAL_MB, journal)], to)
    partition.unlink()
    journal.unlink()
    shutil.rmtree(boot)
    with to.open("rb") as disk:
        digest = hashlib.file_digest(disk, "sha256").hexdigest()
    return Image(to, digest, root)


def build_update(
    to: Path | None, secret: Path, release: Release, site: str = "", expires: date | None = None, store: Path = STORE
) -> Path:
    """Build a root file system of this release, and write it as a signed update; without a key it trusts the secret's.

    A key that is not in it is revoked on every board that it stays on.

    Raises ``DeployError``, ``UpdateError``, ``OSError``.
    """
    version_key(release.version)
    file = to or Path("dist") / f"onboard-{release.version}.update"
    parts = file.with_suffix(".parts")
    root = build_root(parts, release if release.key else replace(release, key=public_key(secret)), store)
    kernel = {KERNEL: root.kernel, INITRD: root.initrd, ROOT: root.squashfs}
    write_bundle(file, kernel, secret, release.version, site, expires)
    shutil.rmtree(parts)
    return file


def make_journal_partition(to: Path) -> Path:
    """An empty ext4 file system called journal."""
    with to.open("wb") as file:
        file.truncate(JOURNAL_MB << 20)
    # The version in Debian 12 takes the time from this variable, later ones from SOURCE_DATE_EPOCH.
    time = str(EPOCH_S)
    words = [
        "-q",
        "-F",
        "-L",
        "journal",
        "-U",
        _JOURNAL_ID,
        "-E",
        f"hash_seed={_JOURNAL_ID},lazy_itable_init=0",
        str(to),
    ]
    run_tool(["mkfs.ext4", *words], E2FSPROGS_FAKE_TIME=time, SOURCE_DATE_EPOCH=time)
    return to

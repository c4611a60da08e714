"""The boot partition: boot loaders, a kernel for each slot, and what a person puts there on a laptop."""

import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from deploy.image.apt import run_tool
from deploy.image.debian import EPOCH_S, Debian, unpack
from deploy.image.layer import FILES
from deploy.image.root import Root
from deploy.image.trees import check_config, write_overlays, write_tree
from deploy.update.slots import SLOTS, STATE_NAME, Slots, to_block

#: Two kernels of 33 MB, one more while an update is written, and room for a person's files.
BOOT_MB = 160
LABEL = "ONBOARD"
#: Where UEFI looks on a disk that it does not know (UEFI 2.10, section 3.5.1.1), and where Debian's GRUB looks.
_LOADER, _CONFIG = "EFI/BOOT/BOOTAA64.EFI", "EFI/debian/grub.cfg"
#: First stage (Pi 3 only), second stage and memory layout of Pi 3 and Pi 4.
_PI_FIRMWARE = ("bootcode.bin", "start.elf", "fixup.dat", "start4.elf", "fixup4.dat")


def boot_files(debian: Debian, root: Root, to: Path, pi_firmware: Path | None = None) -> Path:
    """Write the partition's content as a folder. Raises ``DeployError``, ``OSError``.

    ``pi_firmware`` is Debian's package raspi-firmware, which is not free software and so no part of the image unasked;
    a Raspberry Pi does not start without it.
    """
    shutil.rmtree(to, ignore_errors=True)
    _put(next(debian.grub.rglob("grubaa64.efi")), to / _LOADER)
    _put(FILES / "grub.cfg", to / _CONFIG)
    _put(next(debian.u_boot.rglob("u-boot.bin")), to / "u-boot.bin")
    for name in ("board.cfg", "config.txt", "README.txt"):
        _put(FILES / name, to / name)
    for tree in sorted(debian.kernel.rglob("*.dtb")):
        write_tree(tree, to / tree.name)
    write_overlays(to / "overlays")
    check_config((to / "config.txt").read_text(encoding="utf-8"), sorted(to.glob("*.dtb")), to / "overlays")
    if pi_firmware is not None:
        unpack(pi_firmware, to.parent / "pi", ["./usr/lib/raspi-firmware/*"])
        for name in _PI_FIRMWARE:
            _put(next((to.parent / "pi").rglob(name)), to / name)
        shutil.rmtree(to.parent / "pi")
    for slot in SLOTS:
        (to / slot).mkdir()
    _put(root.kernel, to / SLOTS[0] / "vmlinuz")
    _put(root.initrd, to / SLOTS[0] / "initrd")
    (to / STATE_NAME).write_bytes(to_block(Slots()))
    return to


def make_fat(to: Path, files: Iterable[Path], size_mb: int = BOOT_MB, label: str = LABEL) -> Path:
    """A FAT file system that holds these files and folders; same content, same bytes."""
    with to.open("wb") as file:
        file.truncate(size_mb << 20)
    run_tool(["mkfs.vfat", "-F", "32", "-n", label, "--invariant", str(to)])
    add_files(to, files)
    return to


def add_files(partition: Path, files: Iterable[Path], offset: int = 0) -> None:
    """Copy files and folders into a FAT file system, which may begin within its file at ``offset`` bytes.

    What is there by the same name is replaced. Raises ``DeployError``.
    """
    where = f"{partition}@@{offset}" if offset else str(partition)
    for file in files:
        for inner in [file, *file.rglob("*")]:
            os.utime(inner, (EPOCH_S, EPOCH_S))
        run_tool(
            ["mcopy", "-s", "-m", "-D", "o", "-i", where, str(file), "::"], TZ="UTC", SOURCE_DATE_EPOCH=str(EPOCH_S)
        )


def _put(file: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(file, to)

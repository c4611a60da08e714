"""What the image takes from Debian: a root file system for 64-bit ARM, its kernel, and a shell for the first moments.

The mirrors are those of the build host's own apt. apt keeps lists of its own for this in ``build/image``, so nothing of
the host changes; only making the root file system needs root, and the emulation of ARM programs (binfmt_misc).
"""

import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from deploy.image.apt import ARCHITECTURE, SUITE, Apt, run_tool
from deploy.image.needs import check_needs
from deploy.wheels import DeployError

STORE = Path(__file__).parents[2] / "build" / "image"
#: The least with which systemd, udev, CAN and the program work; all else stays away.
PACKAGES = ("systemd-sysv", "udev", "dbus", "kmod", "python3", "iproute2", "can-utils", "openssl")
#: Time stamps later than this become this, so that a root file system built twice is the same.
EPOCH_S = 1_700_000_000
#: Folders of the package with the modules that boards and emulated machines need.
_KERNEL_PARTS = (
    *(
        "drivers/net/can",
        "net/can",
        "drivers/spi",
        "drivers/virtio",
        "drivers/block",
        "drivers/mmc",
        "drivers/watchdog",
    ),
    *("drivers/usb/host", "drivers/usb/dwc2", "drivers/usb/storage", "drivers/usb/core", "drivers/usb/common"),
    *("drivers/usb/gadget/udc", "drivers/usb/roles", "drivers/usb/phy", "drivers/char/hw_random"),
    *("drivers/rtc", "drivers/i2c/busses"),
    *("fs/squashfs", "fs/ext4", "fs/jbd2", "fs/fat", "fs/nls", "crypto", "lib", "arch/arm64/crypto"),
)
_SINGLE_PARTS = (
    *("fs/mbcache.ko", "drivers/reset/reset-raspberrypi.ko"),
    *("drivers/scsi/scsi_mod.ko", "drivers/scsi/scsi_common.ko", "drivers/scsi/sd_mod.ko"),
)


@dataclass(frozen=True, slots=True)
class Debian:
    """What was fetched: the root file system as an archive; kernel, busybox and the boot loaders unpacked."""

    base: Path
    kernel: Path
    busybox: Path
    grub: Path
    u_boot: Path

    @property
    def release(self) -> str:
        """The kernel's release, as its modules' folder is called."""
        return next((self.kernel / "lib" / "modules").iterdir()).name


def fetch_debian(store: Path = STORE) -> Debian:
    """Fetch and unpack what the store lacks. Raises ``DeployError``, first of all for what this computer lacks."""
    check_needs(store / "base.tar", is_root=os.geteuid() == 0)
    store.mkdir(parents=True, exist_ok=True)
    found = Debian(store / "base.tar", *(store / name for name in ("kernel", "busybox", "grub", "u-boot")))
    apt = Apt(store / "apt")
    if not all(folder.exists() for folder in (found.kernel, found.busybox, found.grub, found.u_boot)):
        apt.run("apt-get", "update", "-q")
        _fetch_packages(apt, found)
    if not found.base.exists():
        apt.run("apt-get", "update", "-q")
        _make_base(apt, found.base)
    return found


def _fetch_packages(apt: Apt, to: Debian) -> None:
    said = apt.run("apt-cache", "depends", f"linux-image-{ARCHITECTURE}").split()
    kernel = next((word for word in said if word.startswith("linux-image-6")), None)
    if kernel is None:
        raise DeployError(f"linux-image-{ARCHITECTURE}: apt does not know it; is this a Debian host?")
    modules = [f"./lib/modules/*/kernel/{part}/*" for part in _KERNEL_PARTS]
    modules += [f"./lib/modules/*/kernel/{part}" for part in _SINGLE_PARTS]
    trees = "./usr/lib/linux-image-*/broadcom/bcm2*"
    wanted = {
        kernel: (to.kernel, ["./boot/vmlinuz-*", "./lib/modules/*/modules.*", trees, *modules]),
        "busybox-static": (to.busybox, ["./bin/busybox"]),
        "grub-efi-arm64-bin": (to.grub, ["./usr/lib/grub/arm64-efi/monolithic/grubaa64.efi"]),
        "u-boot-rpi": (to.u_boot, ["./usr/lib/u-boot/rpi_arm64/u-boot.bin"]),
    }
    for old in apt.folder.glob("*.deb"):
        old.unlink()
    apt.run("apt-get", "download", "-q", *wanted)
    debs = {file.name.partition("_")[0]: file for file in apt.folder.glob("*.deb")}
    for name, (folder, parts) in wanted.items():
        shutil.rmtree(folder, ignore_errors=True)
        unpack(debs[name], folder, parts)
        debs[name].unlink()
    # The links in it are relative to the folder's own root.
    run_tool(["depmod", "-b", str(to.kernel), to.release])


def _make_base(apt: Apt, to: Path) -> None:
    if not Path("/proc/sys/fs/binfmt_misc/qemu-aarch64").exists() and not _runs_arm():
        raise DeployError(
            "this host cannot run ARM programs; apt-get install qemu-user-static binfmt-support arch-test"
        )
    sources = apt.folder / "sources.list"
    sources.write_text("".join(f"deb {line}\n" for line in apt.mirrors()), encoding="utf-8")
    settings = apt.folder / "apt.conf"
    settings.write_text(apt.transport(), encoding="utf-8")
    words = ["mmdebstrap", f"--architectures={ARCHITECTURE}", "--variant=minbase", f"--include={','.join(PACKAGES)}"]
    words += [f"--aptopt={settings}"]
    words += [f"--dpkgopt=path-exclude=/usr/share/{part}/*" for part in ("doc", "man", "locale", "info")]
    part = to.with_suffix(".part.tar")
    run_tool([*words, SUITE, str(part), str(sources)], SOURCE_DATE_EPOCH=str(EPOCH_S))
    part.rename(to)


def _runs_arm() -> bool:
    try:
        return subprocess.run(["arch-test", ARCHITECTURE], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False


def unpack(deb: Path, to: Path, wanted: Sequence[str]) -> None:
    """Unpack what a package has by these patterns. Raises ``DeployError`` where that is nothing."""
    to.mkdir(parents=True)
    with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", str(deb)], stdout=subprocess.PIPE) as reading:
        # A pattern that this kernel has no file for is no mistake.
        subprocess.run(
            ["tar", "-x", "-C", str(to), "--wildcards", *wanted], stdin=reading.stdout, capture_output=True, check=False
        )
    if not any(to.iterdir()):
        raise DeployError(f"{deb.name}: holds nothing of what was looked for")

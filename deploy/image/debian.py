"""What the image takes from Debian: a root file system for 64-bit ARM, its kernel, and a shell for the first moments.

The mirrors are those of the build host's own apt. apt keeps lists of its own for this in ``build/image``, so nothing of
the host changes; only making the root file system needs root, and the emulation of ARM programs (binfmt_misc).
"""

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from deploy.wheels import DeployError

STORE = Path(__file__).parents[2] / "build" / "image"
ARCHITECTURE = "arm64"
SUITE = "bookworm"
#: The least with which systemd, udev, CAN and the program work; all else stays away.
PACKAGES = ("systemd-sysv", "udev", "dbus", "kmod", "python3", "iproute2", "can-utils")
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
    *("fs/squashfs", "fs/ext4", "fs/jbd2", "fs/fat", "fs/nls", "crypto", "lib", "arch/arm64/crypto"),
)
_SINGLE_PARTS = ("fs/mbcache.ko",)
_BUILD_S = 3_600


@dataclass(frozen=True, slots=True)
class Debian:
    """What was fetched: the root file system as an archive, the kernel's and busybox' files unpacked."""

    base: Path
    kernel: Path
    busybox: Path

    @property
    def release(self) -> str:
        """The kernel's release, as its modules' folder is called."""
        return next((self.kernel / "lib" / "modules").iterdir()).name


def fetch_debian(store: Path = STORE) -> Debian:
    """Fetch and unpack what the store lacks. Raises ``DeployError``."""
    store.mkdir(parents=True, exist_ok=True)
    found = Debian(store / "base.tar", store / "kernel", store / "busybox")
    if not found.kernel.exists() or not found.busybox.exists():
        _fetch_packages(store, found)
    if not found.base.exists():
        _make_base(found.base)
    return found


def _fetch_packages(store: Path, to: Debian) -> None:
    apt = _Apt(store / "apt")
    apt.run("apt-get", "update", "-q")
    said = apt.run("apt-cache", "depends", f"linux-image-{ARCHITECTURE}").split()
    kernel = next((word for word in said if word.startswith("linux-image-6")), None)
    if kernel is None:
        raise DeployError(f"linux-image-{ARCHITECTURE}: apt does not know it; is this a Debian host?")
    apt.run("apt-get", "download", "-q", kernel, "busybox-static")
    debs = {file.name.partition("_")[0]: file for file in apt.folder.glob("*.deb")}
    wanted = [f"./lib/modules/*/kernel/{part}/*" for part in _KERNEL_PARTS]
    wanted += [f"./lib/modules/*/kernel/{part}" for part in _SINGLE_PARTS]
    _unpack(debs[kernel], to.kernel, ["./boot/vmlinuz-*", "./lib/modules/*/modules.*", *wanted])
    _unpack(debs["busybox-static"], to.busybox, ["./bin/busybox"])
    # The links in it are relative to the folder's own root.
    _run(["depmod", "-b", str(to.kernel), to.release])


class _Apt:
    """apt for another architecture, with lists and packages of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for part in ("lists/partial", "cache/archives/partial"):
            (folder / part).mkdir(parents=True, exist_ok=True)

    def run(self, tool: str, *words: str) -> str:
        settings = {
            "APT::Architecture": ARCHITECTURE,
            "APT::Architectures": ARCHITECTURE,
            "Dir::State::Lists": str(self.folder / "lists"),
            "Dir::State::status": "/dev/null",
            "Dir::Cache": str(self.folder / "cache"),
            "APT::Sandbox::User": "",
            "Debug::NoLocking": "1",
        }
        options = [word for name, value in settings.items() for word in ("-o", f"{name}={value}")]
        return _run([tool, *options, *words], self.folder)


def _make_base(to: Path) -> None:
    if os.geteuid() != 0:
        raise DeployError("the root file system is made by mmdebstrap, which needs root here; use sudo")
    if not Path("/proc/sys/fs/binfmt_misc/qemu-aarch64").exists() and not _runs_arm():
        raise DeployError(
            "this host cannot run ARM programs; apt-get install qemu-user-static binfmt-support arch-test"
        )
    without = [f"--dpkgopt=path-exclude=/usr/share/{part}/*" for part in ("doc", "man", "locale", "info")]
    words = ["mmdebstrap", f"--architectures={ARCHITECTURE}", "--variant=minbase", f"--include={','.join(PACKAGES)}"]
    part = to.with_suffix(".part.tar")
    _run([*words, *without, SUITE, str(part)], SOURCE_DATE_EPOCH=str(EPOCH_S))
    part.rename(to)


def _runs_arm() -> bool:
    try:
        return subprocess.run(["arch-test", ARCHITECTURE], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False


def _unpack(deb: Path, to: Path, wanted: Sequence[str]) -> None:
    to.mkdir(parents=True)
    with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", str(deb)], stdout=subprocess.PIPE) as reading:
        # A pattern that this kernel has no file for is no mistake.
        subprocess.run(
            ["tar", "-x", "-C", str(to), "--wildcards", *wanted], stdin=reading.stdout, capture_output=True, check=False
        )
    if not any(to.iterdir()):
        raise DeployError(f"{deb.name}: holds nothing of what was looked for")


def _run(words: Sequence[str], folder: Path | None = None, **environment: str) -> str:
    path = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
    try:
        done = subprocess.run(
            words,
            cwd=folder,
            env={**os.environ, "PATH": path, **environment},
            capture_output=True,
            text=True,
            timeout=_BUILD_S,
            check=False,
        )
    except FileNotFoundError:
        raise DeployError(f"{words[0]} is not installed") from None
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise DeployError(f"{words[0]}: {last}")
    return done.stdout

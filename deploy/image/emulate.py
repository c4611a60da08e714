"""A board in QEMU (``-M virt``): the root file system that boards boot, without any board's own boot path."""

import os
import select
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from deploy.image.root import Root
from deploy.wheels import DeployError

QEMU = "qemu-system-aarch64"
MEMORY_MB = 512
#: The guest's clock counts instructions, as in ``hil.guest.machine``; so its times do not depend on the host's load.
_ICOUNT = "shift=1,sleep=off"
_APPEND = "console=ttyAMA0 panic=-1 quiet mitigations=off onboard.root=/dev/vda onboard.emulated"


def make_boot_partition(to: Path, files: list[Path]) -> Path:
    """A FAT file system called ONBOARD that holds these files, as a person's laptop would write it."""
    _make(to, 64, ["mkfs.vfat", "-n", "ONBOARD", str(to)])
    for file in files:
        _run(["mcopy", "-i", str(to), str(file), "::"])
    return to


def make_journal_partition(to: Path) -> Path:
    """An empty ext4 file system called journal."""
    _make(to, 64, ["mkfs.ext4", "-q", "-F", "-L", "journal", str(to)])
    return to


def _make(to: Path, size_mb: int, words: list[str]) -> None:
    with to.open("wb") as file:
        file.truncate(size_mb << 20)
    _run(words)


def _run(words: list[str]) -> None:
    try:
        done = subprocess.run(
            words, env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}, capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        raise DeployError(f"{words[0]} is not installed") from None
    if done.returncode:
        raise DeployError(f"{words[0]}: {done.stderr.strip()[-200:]}")


class Board:
    """A running board. Leaving cuts its power: whatever it was writing stays half written."""

    def __init__(self, root: Root, boot: Path, journal: Path) -> None:
        self.console = ""
        drives = [(root.squashfs, "on"), (boot, "off"), (journal, "off")]
        self._words = [
            *(QEMU, "-M", "virt", "-cpu", "cortex-a53", "-accel", "tcg", "-icount", _ICOUNT, "-rtc", "clock=vm"),
            *("-smp", "1", "-m", str(MEMORY_MB), "-nographic", "-no-reboot", "-nic", "none", "-monitor", "none"),
            *("-serial", "stdio", "-kernel", str(root.kernel), "-initrd", str(root.initrd), "-append", _APPEND),
        ]
        for number, (file, readonly) in enumerate(drives):
            drive = f"file={file},format=raw,if=none,id=d{number},readonly={readonly}"
            self._words += ["-drive", drive, "-device", f"virtio-blk-pci,drive=d{number}"]

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            self._words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()

    def until(self, what: str, is_there: Callable[[str], bool], limit_s: float) -> None:
        """Read the console until ``is_there`` in all of it. Raises ``DeployError`` after so long, with its end."""
        assert self._process.stdout is not None
        end_s = time.monotonic() + limit_s
        while not is_there(self.console):
            ready, _, _ = select.select([self._process.stdout], [], [], max(0.0, end_s - time.monotonic()))
            news = os.read(self._process.stdout.fileno(), 65536) if ready else b""
            if not news:
                raise DeployError(f"not on the console: {what}\n{self.console[-2000:]}")
            self.console += news.decode(errors="replace").replace("\r", "")

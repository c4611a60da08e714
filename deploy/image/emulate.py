"""A board in QEMU (``-M virt``): UEFI firmware, then the image as it would be flashed, boot loader and all."""

import os
import select
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from deploy.image.boot import add_files
from deploy.wheels import DeployError
from hil.guest.effort import LOOK_S, Effort

QEMU = "qemu-system-aarch64"
#: Of Debian's package qemu-efi-aarch64.
FIRMWARE = Path("/usr/share/qemu-efi-aarch64/QEMU_EFI.fd")
MEMORY_MB = 512
#: The guest's clock counts instructions while it works, and follows the host's while it waits, as that of
#: ``hil.guest.machine`` does. Jumping over waits would jump over those for the disk too: the service's start ran into
#: its time-out.
_ICOUNT = "shift=1,sleep=on"
#: Where the boot partition begins in an image.
_BOOT_OFFSET = 1 << 20


def personalise(disk: Path, files: Sequence[Path], options: str = "onboard.emulated") -> None:
    """Put a machine's files onto an image's boot partition, as a person's laptop would, and the kernel's parameters."""
    board = disk.with_name("board.cfg")
    board.write_text(f'set options="{options}"\n', encoding="utf-8")
    add_files(disk, [*files, board], _BOOT_OFFSET)


class Board:
    """A running board with its disk, and with sticks in it. Leaving cuts its power, whatever it was writing."""

    def __init__(self, disk: Path, sticks: Sequence[Path] = ()) -> None:
        #: What was said on the console so far, in whole lines only: half a line says something else, or nothing.
        self.console = ""
        self._half = b""
        self._said = 0
        self._words = [
            *(QEMU, "-M", "virt", "-cpu", "cortex-a53", "-accel", "tcg", "-icount", _ICOUNT, "-rtc", "clock=vm"),
            *("-smp", "1", "-m", str(MEMORY_MB), "-nographic", "-nic", "none", "-monitor", "none"),
            *("-serial", "stdio", "-bios", str(FIRMWARE), "-device", "i6300esb"),
        ]
        for number, file in enumerate([disk, *sticks]):
            drive = f"file={file},format=raw,if=none,id=d{number}"
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
        """Read the console until ``is_there`` in all of its whole lines.

        ``limit_s`` is processor time of the emulator from now on, so that a busy host changes nothing. Raises
        ``DeployError`` with the console's end when it is over, or the board has ended or is stuck (``Effort``).
        """
        assert self._process.stdout is not None
        effort = Effort(self._process.pid, limit_s)
        while not is_there(self.console):
            over = effort.why_over(self._said)
            if over is None and select.select([self._process.stdout], [], [], LOOK_S)[0]:
                news = os.read(self._process.stdout.fileno(), 65536)
                over = None if news else "it has ended"
                self._take(news)
            if over is not None:
                rest = self._half.decode(errors="replace")
                raise DeployError(f"not on the console: {what}; {over}\n{self.console[-2000:]}{rest}")

    def _take(self, news: bytes) -> None:
        self._said += len(news)
        whole, newline, self._half = (self._half + news).rpartition(b"\n")
        self.console += (whole + newline).decode(errors="replace").replace("\r", "")

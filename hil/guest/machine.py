"""One run of a guest: a shell script that the guest's root user runs on the host's own files, read-only."""

import os
import select
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.guest.effort import LOOK_S, Effort
from hil.guest.initrd import BUSYBOX, build_initrd
from hil.guest.kernel import find_kernel

QEMU = "qemu-system-x86_64"
#: Programs of the host that run in the guest, and the packages that hold them.
TOOLS = {"ip": "iproute2", "cangw": "can-utils", "candump": "can-utils", "script": "bsdutils"}
MEMORY_MB = 1536
#: The guest's clock counts its instructions, two nanoseconds each, while it works, and waits with the host's when
#: nothing is to be done (QEMU, "TCG Instruction Counting"): with ``sleep=off`` it would jump to the next timer, and by
#: minutes over waits for a file of the host. So it sees a processor of 500 million instructions a second, about that of
#: a small board, however busy the host is; on the host's clock a busy host would make every controller late.
ICOUNT = "shift=1,sleep=on"
#: The most processor time of the host for a second of the guest's: one of nothing but work takes one to two.
WORK_PER_SECOND = 4.0
#: What is left after the guest's own limit has ended the script: the end of the guest, s of its time.
_END_S = 30.0
#: Exit statuses of a script that was ended by its limit, of busybox's ``timeout``.
_TIMED_OUT = (124, 143)
#: Where an executable names its loader.
_ELF_HEAD = 4096
#: Newer models (``max``) cost a quarter more: their deeper page tables and checks are emulated too.
MODEL = "Nehalem"


class GuestError(Exception):
    """The guest cannot be started, or did not come to its end; ``str`` tells a person why."""


@dataclass(frozen=True, slots=True)
class GuestRun:
    """What came of a run: the script's exit status, what it printed, the guest's console, and the shared folder."""

    status: int
    output: str
    console: str
    share: Path


def missing_for_guest() -> str | None:
    """What this host lacks for a guest, with the remedy; None where nothing is missing."""
    if sys.platform != "linux":
        return "the guest shares the files of a Linux host"
    if shutil.which(QEMU) is None:
        return f"{QEMU} is not installed (apt-get install qemu-system-x86)"
    if not BUSYBOX.exists() or b"ld-linux" in BUSYBOX.read_bytes()[:_ELF_HEAD]:
        return f"no {BUSYBOX} that runs without a loader (apt-get install busybox-static)"
    for tool, package in TOOLS.items():
        if shutil.which(tool, path="/usr/sbin:/usr/bin:/sbin:/bin") is None:
            return f"{tool} is not installed (apt-get install {package})"
    if find_kernel() is None:
        return "the guest has no kernel (python -m hil.guest.kernel)"
    return None


def run_guest(script: str, share: Path, *, limit_s: float, devices: Sequence[str] = ()) -> GuestRun:
    """Boot a guest, run ``script`` in it with /bin/sh, and wait for its end.

    ``share`` is a folder of the host, empty or not, that the guest sees as ``initrd.SHARE`` and may write to.
    ``limit_s`` is in the guest's own time, which a busy host does not change. ``devices`` are further arguments of
    QEMU. Raises ``GuestError`` where the script did not end within ``limit_s``, or the guest left no status: a panic,
    a file system that is missing, a hang (``Effort``).
    """
    why = missing_for_guest()
    kernel = find_kernel()
    if why is not None or kernel is None:
        raise GuestError(why or "no kernel")
    share.mkdir(parents=True, exist_ok=True)
    (share / "script").write_text(script, encoding="utf-8")
    (share / "status").unlink(missing_ok=True)
    initrd = build_initrd(kernel, share.with_suffix(".initrd"), limit_s)
    words = [*_arguments(kernel.image, initrd, share), *devices]
    console = share.with_suffix(".console")
    try:
        over = _emulate(words, console, (limit_s + _END_S) * WORK_PER_SECOND)
    finally:
        initrd.unlink()
    if over is not None:
        raise GuestError(f"the guest did not end: {over}\n{_tail(console, share)}")
    status = share / "status"
    if not status.exists():
        raise GuestError(f"the guest left no status\n{_tail(console, share)}")
    if int(status.read_text()) in _TIMED_OUT:
        raise GuestError(f"the script did not end within {limit_s:g} s of the guest's time\n{_tail(console, share)}")
    output = (share / "output").read_text(encoding="utf-8", errors="replace")
    return GuestRun(int(status.read_text()), output, console.read_text(errors="replace"), share)


def _emulate(words: Sequence[str], console: Path, limit_s: float) -> str | None:
    """Run an emulator to its end; why it had to be ended, or None. ``limit_s`` is processor time."""
    with console.open("wb") as out:
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)
    try:
        ended = os.pidfd_open(process.pid)
        try:
            effort = Effort(process.pid, limit_s)
            while not select.select([ended], [], [], LOOK_S)[0]:
                over = effort.why_over(console.stat().st_size)
                if over is not None:
                    return over
        finally:
            os.close(ended)
        return None
    finally:
        process.kill()
        process.wait()


def _arguments(image: Path, initrd: Path, share: Path) -> list[str]:
    everything = "local,path=/,mount_tag=root,security_model=none,readonly=on,multidevs=remap"
    results = f"local,path={share},mount_tag=share,security_model=none,multidevs=remap"
    return [
        *(QEMU, "-M", "q35", "-accel", "tcg", "-icount", ICOUNT, "-rtc", "clock=vm", "-cpu", MODEL),
        *("-smp", "1", "-m", str(MEMORY_MB)),
        *("-nographic", "-no-reboot", "-nic", "none", "-monitor", "none", "-serial", "stdio"),
        *("-kernel", str(image), "-initrd", str(initrd)),
        *("-append", "console=ttyS0 quiet panic=-1 mitigations=off random.trust_cpu=on"),
        *("-virtfs", everything, "-virtfs", results),
    ]


def _tail(console: Path, share: Path) -> str:
    texts = [file.read_text(errors="replace") for file in (console, share / "output") if file.exists()]
    return "\n".join(line for text in texts for line in text.splitlines()[-30:])

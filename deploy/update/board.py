"""What an update needs of the board that it runs on: its slots, its boot partition, and what it says of itself."""

import contextlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from subprocess import run

from deploy.update.manifest import BOARD, Running, UpdateError, today
from deploy.update.slots import SLOTS, STATE_BYTES, STATE_NAME, Slots, from_block, to_block
from onboard.config.machine import MachineConfig, load_machine
from onboard.config.problems import ConfigError

#: Marks our disk, where an MBR has its disk signature (bytes 440 to 443).
SIGNATURE = b"ONBD"
#: Number of each slot's partition on it.
PARTITIONS = dict(zip(SLOTS, (2, 3), strict=True))
_BOOT = Path("/boot/onboard")
_RELEASE = Path("/etc/onboard/release.json")
_KEY = Path("/etc/onboard/update.pem")


@dataclass(frozen=True, slots=True)
class BoardFiles:
    """A board's files and devices; ``writable`` holds the boot partition open for writing."""

    running: str
    devices: Mapping[str, Path]
    boot: Path
    release: Path
    key: Path
    writable: Callable[[], AbstractContextManager[None]]
    today: Callable[[], date] = today

    def state(self) -> Slots:
        """What the boot loader will do."""
        try:
            return from_block((self.boot / STATE_NAME).read_bytes())
        except FileNotFoundError:
            return Slots()

    def keep(self, state: Slots) -> None:
        """Write the state in place, durably. The boot partition must be writable."""
        descriptor = os.open(self.boot / STATE_NAME, os.O_WRONLY | os.O_CREAT, 0o644)
        try:
            os.pwrite(descriptor, to_block(state), 0)
            os.ftruncate(descriptor, STATE_BYTES)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def itself(self) -> Running:
        """The system that runs, and its machine's site, "" where no valid machine file says one."""
        said = json.loads(self.release.read_text(encoding="utf-8"))
        machine = self.machine()
        site = machine.site.name if machine is not None else ""
        return Running(said["version"], said["board"], site, self.today(), self.state().failed)

    def machine(self) -> MachineConfig | None:
        """What the machine file says, None where it is not in order."""
        try:
            return load_machine(self.boot / "machine.toml")
        except ConfigError:
            return None


def this_board() -> BoardFiles:
    """The board that this runs on. Raises ``UpdateError`` where it was not started from our image."""
    found = re.search(r"\bonboard\.slot=([ab])\b", Path("/proc/cmdline").read_text(encoding="ascii"))
    devices = {slot: device for slot, number in PARTITIONS.items() if (device := _partition(number)) is not None}
    if found is None or len(devices) < len(SLOTS):
        raise UpdateError(f"this system was not started from an image of ours for {BOARD} boards; there are no slots")
    return BoardFiles(found[1], devices, _BOOT, _RELEASE, _KEY, _remounted)


def _partition(number: int) -> Path | None:
    """The device of a partition of our disk, whatever the board calls it."""
    for file in sorted(Path("/sys/class/block").glob("*/partition")):
        part = file.parent
        disk = Path("/dev", part.resolve().parent.name)
        if int(file.read_text()) == number and _signature(disk) == SIGNATURE:
            return Path("/dev", part.name)
    return None


def _signature(disk: Path) -> bytes:
    with disk.open("rb") as device:
        return device.read(512)[440:444]


@contextlib.contextmanager
def _remounted() -> Iterator[None]:
    """The boot partition is read-only, but for these moments."""
    run(["mount", "-o", "remount,rw", str(_BOOT)], check=True)
    try:
        yield
    finally:
        os.sync()
        run(["mount", "-o", "remount,ro", str(_BOOT)], check=True)

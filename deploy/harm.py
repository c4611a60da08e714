"""What ``pytest deploy`` does to a controller, inside an emulated board: kill it, freeze it, then write without end.

Nothing of this is in the image that people flash. At the board's next start it only tells what is in its own journal.
"""

import asyncio
import os
import select
import signal
import subprocess
from pathlib import Path

from onboard.io.journal import FileJournal

#: Beside the controller's own journal, on the same partition.
FOLDER = Path("/var/lib/onboard/test")
#: Long enough for heartbeats of this life.
_LIFE_S = 3


def main() -> None:
    """Runs as a service of its own, as root."""
    if not FOLDER.exists():
        _wait_for_life(0)
        print(Path("/proc/meminfo").read_text(encoding="ascii"), flush=True)
        print(f"test: the controller's memory: {_show('MemoryCurrent')}", flush=True)
        os.kill(int(_show("MainPID")), signal.SIGKILL)
        _wait_for_life(1)
        os.kill(int(_show("MainPID")), signal.SIGSTOP)
        _wait_for_life(2)
    asyncio.run(_write())


def _wait_for_life(restarts: int) -> None:
    while (_show("NRestarts"), _show("ActiveState")) != (str(restarts), "active"):
        select.select([], [], [], 0.5)
    select.select([], [], [], _LIFE_S)


def _show(what: str) -> str:
    words = ["systemctl", "show", "--value", "--property", what, "onboard.service"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


async def _write() -> None:
    journal = FileJournal(FOLDER, "test")
    records = len(journal.replay())
    if records:
        print(f"test: found {records} records, {journal.condition.state.name}", flush=True)
        return
    while True:
        records += 1
        await journal.append({"record": records, "filling": "x" * 300})
        print(f"test: record {records}", flush=True)


if __name__ == "__main__":
    main()

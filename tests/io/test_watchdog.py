"""sd_notify, heard by a socket in the place of systemd."""

import os
import socket
from pathlib import Path

import pytest

from onboard.io.watchdog import SystemdWatchdog
from tests.tools import DEADLINE_S


@pytest.mark.parametrize("abstract", [False, True])
def test_the_manager_hears_each_state(tmp_path: Path, abstract: bool) -> None:
    name = f"@onboard-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("\0" + name[1:] if abstract else name)
        manager.settimeout(DEADLINE_S)
        watchdog = SystemdWatchdog({"NOTIFY_SOCKET": name})
        watchdog.ready()
        watchdog.alive()
        watchdog.status("parks\nC7")
        watchdog.close()
        watchdog.alive()
        heard = [manager.recv(200) for _ in range(4)]
    assert heard == [b"READY=1", b"WATCHDOG=1", b"STATUS=parks C7", b"STOPPING=1"]
    assert watchdog.failures == 0


def test_nothing_happens_without_a_manager() -> None:
    watchdog = SystemdWatchdog({})
    watchdog.ready()
    assert watchdog.failures == 0
    assert watchdog.period_us == 0


def test_a_deaf_manager_is_counted(tmp_path: Path) -> None:
    watchdog = SystemdWatchdog({"NOTIFY_SOCKET": str(tmp_path / "nobody")})
    watchdog.alive()
    watchdog.close()
    assert watchdog.failures == 2


def test_the_period_is_for_this_process_only() -> None:
    asked = {"WATCHDOG_USEC": "3000000"}
    assert SystemdWatchdog(asked).period_us == 3_000_000
    assert SystemdWatchdog({**asked, "WATCHDOG_PID": str(os.getpid())}).period_us == 3_000_000
    assert SystemdWatchdog({**asked, "WATCHDOG_PID": "1"}).period_us == 0
    assert SystemdWatchdog({"WATCHDOG_USEC": "soon"}).period_us == 0

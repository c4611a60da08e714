"""The services of a board: systemd takes them, and what they start does what they say."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from deploy.image.layer import FILES as IMAGE_FILES
from deploy.package import FILES
from onboard.io.endings import ExitStatus
from tests.tools import require_tool, run_tool

UNITS = sorted(FILES.glob("*.service"))


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_systemd_takes_the_unit(unit: Path, tmp_path: Path) -> None:
    require_tool("systemd-analyze")
    # The programs are not installed here; which ones a unit names is looked at below.
    text = unit.read_text()
    for program in ("/usr/bin/onboard", "/usr/lib/onboard/record", "/usr/lib/onboard/clock"):
        text = text.replace(program + " ", "/bin/true ").replace(program + "\n", "/bin/true\n")
    (tmp_path / unit.name).write_text(text)
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(tmp_path / unit.name)],
        capture_output=True,
        text=True,
        check=False,
    )
    complaints = [line for line in done.stderr.splitlines() if unit.name in line]
    assert done.returncode == 0 and complaints == [], done.stderr


@pytest.mark.parametrize(
    ("units", "most"),
    [
        (["onboard.service"], 2.0),
        # On our image the user is there from the beginning.
        (["onboard.service", "image.conf"], 2.0),
        (["onboard-gateway.service"], 2.0),
        (["onboard-recorder.service"], 2.0),
        (["onboard-web.service"], 2.0),
        (["onboard-stick.service"], 4.0),
    ],
)
def test_a_service_has_no_more_of_the_board_than_it_needs(units: list[str], most: float, tmp_path: Path) -> None:
    """As systemd counts exposure, from 0 to 10."""
    require_tool("systemd-analyze")
    unit = tmp_path / units[0]
    places = (FILES, IMAGE_FILES)
    unit.write_text("".join(file.read_text() for name in units for place in places for file in place.glob(name)))
    words = ["--offline=true", "--no-pager", f"--threshold={most * 10:.0f}", str(unit)]
    done = subprocess.run(["systemd-analyze", "security", *words], capture_output=True, text=True, check=False)
    assert "Overall exposure level" in done.stdout
    assert done.returncode == 0, "".join(line + "\n" for line in done.stdout.splitlines() if "✗" in line or "→" in line)


def test_every_service_comes_back_and_none_after_a_mistake() -> None:
    for unit in UNITS:
        lines = unit.read_text().splitlines()
        if unit.stem == "onboard-clock":
            continue
        assert "StartLimitIntervalSec=0" in lines, unit.name
        assert any(line in ("Restart=on-failure", "Restart=always") for line in lines), unit.name
        if unit.stem in ("onboard-gateway", "onboard-web"):
            assert f"RestartPreventExitStatus={ExitStatus.MISTAKE:d}" in lines


def said(folder: Path, *, ntp: str, wait_s: int = 0) -> str:
    (folder / "timedatectl").write_text(f"#!/bin/sh\necho {ntp}\n")
    (folder / "timedatectl").chmod(0o755)
    environment = {
        "PATH": f"{folder}:{os.environ['PATH']}",
        "ONBOARD_CLOCK_SYS": str(folder / "sys"),
        "ONBOARD_CLOCK_WAIT_S": str(wait_s),
    }
    return subprocess.run([str(FILES / "clock")], env=environment, capture_output=True, text=True, check=True).stdout


def test_where_the_time_comes_from_is_told(tmp_path: Path) -> None:
    assert "no real-time clock that was set, and no time server" in said(tmp_path, ntp="no")
    assert "comes from a time server" in said(tmp_path, ntp="yes")
    clock = tmp_path / "sys" / "class" / "rtc" / "rtc0"
    clock.mkdir(parents=True)
    (clock / "name").write_text("rtc-ds1307 1-0068\n")
    # Its battery is empty: it began again at 2000.
    (clock / "since_epoch").write_text("946684800\n")
    assert "no real-time clock that was set" in said(tmp_path, ntp="no")
    (clock / "since_epoch").write_text("1900000000\n")
    assert "comes from rtc0 (rtc-ds1307 1-0068)" in said(tmp_path, ntp="no")


def test_the_recorder_keeps_the_newest_files_in_their_order(tmp_path: Path) -> None:
    """Also on a board whose clock shows any day."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "candump").write_text('#!/bin/sh\necho "$@"\n')
    (tmp_path / "bin" / "candump").chmod(0o755)
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "note.txt").write_text("a person's own")
    environment = {
        "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
        "STATE_DIRECTORY": str(logs),
        "INTERFACE": "can7",
    }
    for _ in range(20):
        subprocess.run([str(FILES / "record")], env=environment, check=True)
    kept = sorted(file.name for file in logs.glob("*.log"))
    assert [name[:6] for name in kept] == [f"{number:06}" for number in range(5, 21)]
    assert (logs / kept[-1]).read_text() == "-L -r 8388608 can7\n"
    assert (logs / "note.txt").exists()


@pytest.mark.parametrize("script", ["clock", "record", "onboard"])
def test_the_scripts_are_ones_of_any_shell(script: str) -> None:
    run_tool(shutil.which("dash") or "sh", "-n", str(FILES / script))

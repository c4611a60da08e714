"""What a user installs: the wheel holds the data, names its needs, and its version is the program's."""

import os
import shutil
import subprocess
import sys
import zipfile
from email.message import Message
from email.parser import Parser
from pathlib import Path

import pytest

import onboard
from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]
PACKAGES = ("bus_sim", "dbc", "hil", "onboard")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel built from the sources by the declared build backend, without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
        timeout=DEADLINE_S,
    )
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    """The wheel's METADATA file."""
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return Parser().parsestr(archive.read(name).decode("utf-8"))


def test_the_wheel_holds_every_source_and_data_file_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
    here = {
        file.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for file in (ROOT / package).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert inside == here
    assert {"dbc/fleet.dbc", "dbc/device.dbc", "bus_sim/sites/level1.toml", "onboard/py.typed"} <= inside


def test_the_wire_contract_is_found_inside_the_wheel(wheel: Path) -> None:
    code = f"import sys; sys.path.insert(0, {str(wheel)!r}); import dbc; print(dbc.__file__, dbc.fleet_dbc_text()[:7])"
    run = subprocess.run(
        [sys.executable, "-I", "-c", code],
        cwd=wheel.parent,
        check=True,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
    )
    assert ".whl" in run.stdout
    assert "VERSION" in run.stdout


def test_version_python_and_licence(metadata: Message) -> None:
    assert metadata["Name"] == "onboard-fleet"
    assert metadata["Version"] == onboard.__version__
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["License-Expression"] == "Apache-2.0"
    assert set(metadata.get_all("License-File", [])) >= {"LICENSE", "NOTICE", "THIRD_PARTY.md"}


def test_a_board_carries_two_libraries_and_no_more(metadata: Message) -> None:
    needs = metadata.get_all("Requires-Dist", [])
    assert sorted(need for need in needs if "extra ==" not in need) == ["cantools<46,>=45.1", "python-can<5,>=4.6.1"]


def test_the_notices_name_every_direct_dependency(metadata: Message) -> None:
    notices = (ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8")
    for need in metadata.get_all("Requires-Dist", []):
        if "extra == 'test'" not in need:
            name = need.split("<")[0].split(">")[0].split(";")[0].strip()
            assert f"| {name} " in notices, f"{name} has no line in THIRD_PARTY.md"


def test_both_commands_are_installed(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/entry_points.txt"))
        text = archive.read(name).decode("utf-8")
    assert "onboard = onboard.__main__:main" in text
    assert "bus-sim = bus_sim.__main__:main" in text


def make(*arguments: str) -> subprocess.CompletedProcess[str]:
    """``make`` as a person would call it, not as a part of the make that may run these tests."""
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    return subprocess.run(
        ["make", *arguments], cwd=ROOT, env=environment, check=False, capture_output=True, text=True, timeout=DEADLINE_S
    )


def test_make_without_a_usable_python_says_what_to_do(tmp_path: Path) -> None:
    run = make("run", "PYTHON=/no/such/python", f"VENV={tmp_path / 'venv'}")
    assert run.returncode == 2
    assert "no usable Python among: /no/such/python" in run.stderr
    assert "apt install python3-venv" in run.stderr
    assert not (tmp_path / "venv").exists()


def test_make_help_lists_every_target() -> None:
    run = make("help")
    assert run.returncode == 0
    assert [line.split()[1] for line in run.stdout.splitlines()[:14]] == [
        *(
            "help",
            "run",
            "check",
            "test",
            "test-long",
            "coverage",
            "lint",
            "format",
            "models",
            "mutants",
            "bench",
            "docs",
        ),
        "audit",
        "clean",
    ]

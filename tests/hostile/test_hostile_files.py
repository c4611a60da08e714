"""Files that would do harm end in one line each, in five seconds and in 200 MB, through the commands that read them."""

import ast
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.fleet import write_fleet
from onboard import bounded_file
from onboard.bounded_file import read_bounded
from tests.hostile.files import hostile, made
from tests.hostile.play import Outcome, Play
from tests.once import once
from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]
MOST_CPU_S, MOST_MEMORY, MOST_SHOWN = 5.0, 200_000_000, 1_000
TABLE = list(hostile())
PACKAGES, PATHS = ("bus_sim", "deploy", "hil", "onboard"), ("Path", "_existing")
#: Every option of every command that names a file to be read, and the rows that try its reader.
READ = {
    "--add-to": "ledger",
    "--card": "old board",
    "--counts": "counts",
    "--dbc": "DBC",
    "--journal": "old journal",
    "--key": "key of updates",
    "--keys": "keys",
    "--machine": "machine file",
    "--mapping": "mapping",
    "--mqtt-ca": "authority",
    "--mqtt-cert": "certificate",
    "--mqtt-key": "certificate's key",
    "--mqtt-password": "broker's password",
    "--play": "counterexample",
    "--roles": "roles",
    "--scenario": "scenario",
    "--serve-token": "served bus's token",
    "--sessions": "sessions",
    "--site": "site",
    "--spool": "journal",
    "--web-token": "page's token",
    "files": "YAML",
    "log": "log",
    "old": "site",
    "site": "site",
}
#: What is written, handed to a tool of others (openssl, dpkg-deb), the folder of it, or read on a board only: an update
#: (tests/deploy/test_update.py).
WRITTEN = {
    "--counterexample",
    "--draw",
    "--folder",
    "--json",
    "--junit",
    "--networkd",
    "--out",
    "--parquet",
    "--pi-firmware",
    "--process-dir",
    "--protocol",
    "--secret",
    "--share",
    "--stick",
    "--trace",
    "-o",
    "file",
    "out",
}


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Outcome]:
    told = json.loads((once("hostile", _play_all) / "outcomes.json").read_text(encoding="utf-8"))
    return {one.name: Outcome(*outcome) for one, outcome in zip(TABLE, told, strict=True)}


def _play_all(folder: Path) -> None:
    (folder / "log").write_bytes(b"(1795219200.000000) fleet 18FF0201#08C3\n")
    (folder / "sessions.csv").write_text("arrival,departure\n", encoding="ascii")
    (folder / "small.map").write_text("type octile\nheight 1\nwidth 3\nmap\n...\n", encoding="ascii")
    write_fleet(Path("small"), folder / "boards")
    (folder / "boards" / "MR1").rename(folder / "card")
    plays = []
    for number, one in enumerate(TABLE):
        path = made(one, folder, number)
        named = path.parent if one.suffix.startswith("/") else path
        plays.append(Play(words=one.command.format(named).split(), endless=[str(path)] if one.content is None else []))
    ran = subprocess.run(
        [sys.executable, "-m", "tests.hostile.play"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests" / "plugin")))},
        input=json.dumps(plays),
        capture_output=True,
        text=True,
        check=True,
        timeout=20 * DEADLINE_S,
    )
    (folder / "outcomes.json").write_text(ran.stdout, encoding="utf-8")


def test_there_are_forty_and_each_has_a_name() -> None:
    assert len({one.name for one in TABLE}) == len(TABLE) >= 40


@pytest.mark.parametrize("name", [one.name for one in TABLE])
def test_a_hostile_file_is_one_line_and_costs_little(outcomes: dict[str, Outcome], name: str) -> None:
    found = outcomes[name]
    assert found.status == 2, found.said[-1_000:]
    assert found.said.count("\n") == 1 and 0 < len(found.said) <= MOST_SHOWN, found.said[:1_000]
    assert found.cpu_s < MOST_CPU_S and found.memory < MOST_MEMORY, found


def test_every_option_that_takes_a_file_is_tried_or_only_written() -> None:
    """A new one belongs into one of the two tables."""
    tried = {name.partition(":")[0] for name in (one.name for one in TABLE)}
    assert set(READ.values()) <= tried
    found = {option for package in PACKAGES for path in (ROOT / package).rglob("*.py") for option in _options(path)}
    assert found == READ.keys() | WRITTEN


def _options(path: Path) -> Iterator[str]:
    text = path.read_text(encoding="utf-8")
    if "add_argument(" not in text:
        return
    for call in ast.walk(ast.parse(text)):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "add_argument":
            words = {one.arg: ast.unparse(one.value).strip("'") for one in call.keywords}
            name = next((one.value for one in call.args if isinstance(one, ast.Constant)), "")
            if words.get("type") in PATHS or words.get("metavar") in ("FILE", "LOG") or name in ("site", "log"):
                yield str(name)


def test_a_pipe_that_ends_in_time_is_read_whole(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.write(writer, b"x" * 10_000)
    os.close(writer)
    assert read_bounded(Path(f"/dev/fd/{reader}")) == b"x" * 10_000
    os.close(reader)
    whole = tmp_path / "whole"
    whole.write_bytes(bytes(100))
    assert read_bounded(whole, 100) == bytes(100)
    with pytest.raises(OSError, match="is longer than"):
        read_bounded(whole, 99)


def test_a_pipe_into_which_nobody_writes_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_file, "PATIENCE_S", 0.0)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(TimeoutError, match="does not come to its end within 0 s"):
        read_bounded(tmp_path / "pipe")

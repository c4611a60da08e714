"""One mistake of a person is one line: the option or file, the value and what to do; and exit status 2, at once."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from deploy.cli import main as deploy
from onboard.cli import main as onboard

#: Longer than any file system takes a name.
LONG = "a" * 300
#: Program, what was typed, and what the line says.
MISTAKES = [
    (bus_sim, "foo", r"argument COMMAND: invalid choice: 'foo' .*see bus-sim --help"),
    (bus_sim, "run --seed x", r"argument --seed: invalid int value: 'x'; see bus-sim run --help"),
    (bus_sim, "run small extra", r"unrecognized arguments: extra; see bus-sim --help"),
    (bus_sim, "run --for -5", r"--for -5: must be seconds above 0"),
    (bus_sim, "run cell --for nan", r"--for nan: must be seconds above 0"),
    (bus_sim, "run small --trace gone/t.log", r"--trace gone/t.log: there is no folder gone; make it first, or name"),
    (bus_sim, "run cell --trace gone/t.log", r"--trace gone/t.log: there is no folder gone"),
    (bus_sim, "run small --trace folder", r"--trace folder: is a folder; name a file in it"),
    (bus_sim, "run terminal --json folder", r"--json folder: is a folder; name a file in it"),
    (bus_sim, "run --serve 127.0.0.1:99999", r"--serve 127.0.0.1:99999: must be HOST:PORT, such as"),
    (
        bus_sim,
        "run --sessions semicolons.csv",
        r"semicolons.csv:1: no column arrival, .*divided by another character; add --delimiter semi",
    ),
    (bus_sim, "run --sessions tabs.csv", r"tabs.csv:1: no column arrival, .*add --delimiter tab"),
    (bus_sim, "run cell --was cell", r"cell: no machine is added; name the site file that is to come"),
    (bus_sim, "run small --was small", r"small: rights of a site of system car-park begin by its file"),
    (bus_sim, "run small --was gone", r'site "gone": no such file'),
    (bus_sim, "run small --was small --processes", r"--was: with --processes each machine reads its site file itself"),
    (bus_sim, "run small --was small --change-at -1", r"--change-at -1: must be seconds, 0 or more"),
    (bus_sim, "compare --json gone/t.json", r"--json gone/t.json: there is no folder gone"),
    (bus_sim, "campaign small --json gone/t.json", r"--json gone/t.json: there is no folder gone"),
    (bus_sim, "campaign small --out file", r"--out file: is a file; name a folder"),
    (bus_sim, "campaign small --scene overlap", r"--scene overlap: goes with --exhaustive; add it, or leave this out"),
    (bus_sim, "attack small --json gone/t.json", r"--json gone/t.json: there is no folder gone"),
    (bus_sim, "certify graph --capacity 0", r"--capacity 0: must be 1 or more"),
    (bus_sim, "certify graph --counterexample gone/t", r"--counterexample gone/t: there is no folder gone"),
    (bus_sim, "import file -o gone/t.toml", r"--output gone/t.toml: there is no folder gone"),
    (onboard, "", r"the following arguments are required: --machine; see onboard --help"),
    (onboard, "trace foo", r"argument COMMAND: invalid choice: 'foo' .*see onboard trace --help"),
    (onboard, "trace load file --site small --bitrate x", r"unrecognized arguments|invalid"),
    (onboard, "operate status --site small", r"name a bus: -i INTERFACE -c CHANNEL; see onboard operate --help"),
    (onboard, "gateway --site small -i virtual -c x", r"arguments are required: --mqtt; see onboard gateway --help"),
    (onboard, "web --site small", r"name a log, or a bus: -i INTERFACE -c CHANNEL; see onboard web --help"),
    (bus_sim, f"run {LONG}", r"no such file, and no such shipped site"),
    (bus_sim, f"run small --trace {LONG}", r"--trace a+: File name too long; name another file"),
    (bus_sim, f"campaign small --out {LONG}", r"--out a+: File name too long"),
    (onboard, f"trace check file --site {LONG}", r"no such file, and no such shipped site"),
    (onboard, f"--machine {LONG}", r"cannot be read \(File name too long\); name an existing machine file"),
    (onboard, "trace replay file --site small --machine MR1 --raise-costs -1", r"--raise-costs -1: must be from 0 to"),
    (bus_sim, "run small --random inf 5", r"--random: mean inf s: must be above 0, and at most 1000000"),
    (bus_sim, "run small --random 20 5 --cars 99999999", r"--cars 99999999: must be from 0 to 100000"),
    (bus_sim, "run small --one-car 1e18", r"--one-car 1e\+18: must be seconds from 0 to 1000000"),
    (bus_sim, "run small --one-car 60 --for 1e308", r"--for 1e\+308: must be seconds above 0, and at most 1000000"),
    (bus_sim, "campaign small --seeds 1-99999999", r"--seeds 1-99999999: more than 1000000; play them in parts"),
    (bus_sim, f"campaign small --seeds {'1' * 5_000}", r"--seeds 1+: must be a seed, or the first and the last of"),
    (bus_sim, f"run small --random 20 5 --inside {'1' * 5_000}", r"--inside 1+: must be a number of cars from 0 to"),
    (bus_sim, "run small --web ²", r"--web ²: must be PORT or HOST:PORT"),
    (bus_sim, "run small --serve 127.0.0.1:²", r"--serve 127.0.0.1:²: must be HOST:PORT"),
    (onboard, "trace why file IOC1/² --site small", r"task 'IOC1/²': write CALLER/NUMBER"),
    (
        onboard,
        "trace diagram file --site small --out d.svg --from nan",
        r"argument --from: nan: must be seconds from 0",
    ),
    (onboard, "operate stop --site small --for inf", r"argument --for: inf: must be seconds from 0 to 100000000"),
    (onboard, "keys make small --tools ²", r"--tools ²: is no node-ID of a tool"),
    (bus_sim, "campaign small --cars 99999999", r"--cars 99999999: must be from 1 to 100000"),
    (bus_sim, "attack graph --orders 99999999", r"--orders 99999999: must be from 0 to 10000"),
    (bus_sim, "compare small --seeds 2-1", r"--seeds 2-1: must be a seed, or the first and the last of several"),
    (bus_sim, "compare small --cars -1", r"cars -1: must be from 0 to 100000"),
    (
        *(onboard, "conform --site level1 --node 11 --kind robot -i virtual -c x --junit folder"),
        r"folder: Is a directory; name another file",
    ),
    (deploy, "foo", r"argument COMMAND: invalid choice: 'foo' .*see python -m deploy --help"),
    (deploy, "update --secret gone", r"argument --secret: gone: no such file; see python -m deploy update --help"),
]


@pytest.mark.parametrize(
    ("program", "words", "told"), MISTAKES, ids=lambda value: value[:60] if type(value) is str else ""
)
def test_a_mistake_is_one_line_and_status_2(
    program: Callable[[list[str]], int],
    words: str,
    told: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("(1.000000) fleet 123#11\n")
    (tmp_path / "semicolons.csv").write_text("arrival;departure;station_id;session_id\n")
    (tmp_path / "tabs.csv").write_text("arrival\tdeparture\tstation_id\tsession_id\n")
    before = sorted(tmp_path.iterdir())
    try:
        status: object = program(words.split())
    except SystemExit as ended:
        status = ended.code
    error = capsys.readouterr().err
    assert status == 2
    assert error.count("\n") == 1 and re.search(told, error), error
    assert sorted(tmp_path.iterdir()) == before, "nothing half done"

"""``bus-sim compare`` as a person uses it."""

import json
from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.systems.car_park.compare import command
from bus_sim.systems.car_park.compare.plays import MIP, POLICIES


def test_p56_one_command_makes_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = tmp_path / "table.json"
    words = ["--parts", "random", "--seeds", "1", "--cars", "2", "--jobs", "1", "--json", str(told)]
    assert main(["compare", "small", *words]) == 0
    out = capsys.readouterr().out
    lines = [line for line in out.splitlines() if line.startswith("| ")]
    assert [line.split(" | ")[0].removeprefix("| ") for line in lines[1:]] == [*POLICIES]
    rows = json.loads(told.read_text(encoding="utf-8"))["random"]["rows"]
    assert [row["policy"] for row in rows] == [*POLICIES]
    assert all(row["to_bays_alone"] >= 1 and row["to_free_flow"] >= 1 for row in rows)
    assert all(0 < row["empty_share"] < 1 and row["messages_per_task"] > 0 for row in rows)


def test_a_window_of_a_day_counts_only_its_own_customers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On the shipped day of level 1 cars come at 5:35, 5:48 and 5:49, the next after six."""
    told = tmp_path / "table.json"
    options = ["--parts", "day", "--window", "05:40-06:00", "--jobs", "1", "--json", str(told)]
    assert main(["compare", "level1", *options]) == 0
    assert "level1: 2019-07-24 05:40 to 06:00" in capsys.readouterr().out
    rows = json.loads(told.read_text(encoding="utf-8"))["day"]["rows"]
    assert [row["wait_in"]["count"] for row in rows] == [2] * len(POLICIES)


def test_choices_of_places_are_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = tmp_path / "table.json"
    monkeypatch.setattr(command, "POLICIES", {MIP: POLICIES[MIP]})
    words = ["--parts", "random", "--seeds", "3", "--cars", "1", "--jobs", "1", "--place", "nearest,random"]
    assert main(["compare", "small", *words, "--json", str(told)]) == 0
    nearest, drawn = json.loads(told.read_text(encoding="utf-8"))["random"]["rows"]
    assert [(row["policy"], row["place"]) for row in (nearest, drawn)] == [(MIP, "nearest"), (MIP, "random")]
    assert nearest["loaded_m"] == 0 < drawn["loaded_m"], "the place beside the bay, or any"
    assert nearest["empty_m"] > 0


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        (["--seeds", "5-1"], "the first and the last of several"),
        (["--seeds", "one"], "the first and the last of several"),
        (["--place", "far"], "some of nearest, cost, stay, balanced, random"),
        (["--parts", "nights"], "some of random, day, small, stored"),
        (["--parts", "random", "--random", "0", "1"], "must be above 0"),
    ],
)
def test_a_mistake_gives_one_line(options: list[str], remedy: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "small", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("bus-sim: ")
    assert remedy in line

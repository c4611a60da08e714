"""``bus-sim design`` as a person uses it."""

import json
from argparse import Namespace
from datetime import date
from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.sites import find_site
from bus_sim.systems.car_park.design.days import days_of
from bus_sim.systems.car_park.design.options import Size, size_of
from onboard.systems.car_park.site import CarPark, car_park

HEAD = "arrival,departure,session_id\n"
USUAL: dict[str, object] = {
    **dict.fromkeys(("counts", "day", "inside", "columns", "delimiter", "zone", "date_format", "encoding", "mapping")),
    "skip_bad": False,
}


def table(folder: Path, days: int) -> Path:
    """Two cars on each day of June 2024 from the third on, a Monday; the second stays over the night."""
    rows = [
        f"2024-06-{day:02}T08:00:00+02:00,2024-06-{day:02}T09:00:00+02:00,a{day}\n"
        f"2024-06-{day:02}T08:01:00+02:00,2024-06-{day + 2:02}T09:00:00+02:00,b{day}\n"
        for day in range(3, 3 + days)
    ]
    file = folder / "cars.csv"
    file.write_text(HEAD + "".join(rows), encoding="utf-8")
    return file


def test_days_to_search_by_and_others_are_kept_apart(tmp_path: Path) -> None:
    asked = Namespace(**USUAL, sessions=table(tmp_path, 10), days=5, unseen=3)
    found = days_of(asked, car_park(find_site("small")))
    seen, unseen = ([one.label for one in plans] for plans in (found.seen, found.unseen))
    assert (len(seen), len(unseen)) == (5, 3) and not set(seen) & set(unseen)
    assert all(date.fromisoformat(label).weekday() < 5 for label in seen + unseen), "working days"
    stays = found.seen[0].demand.stays
    assert [stay.departure_us is None for stay in stays] == [False, True], "who stays over the night is not fetched"
    assert stays[0].arrival_us == 8 * 3_600_000_000


def test_one_day_is_played_with_other_people(tmp_path: Path) -> None:
    asked = Namespace(**USUAL, sessions=table(tmp_path, 1), days=2, unseen=1)
    found = days_of(asked, car_park(find_site("small")))
    assert [one.label for one in found.seen + found.unseen] == ["seed 1", "seed 2", "seed 3"]
    assert found.seen[0].demand.stays[0].car != found.seen[1].demand.stays[0].car


def test_one_command_finds_the_fewest_and_writes_a_site_that_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = ["--out", "winner.toml", "--draw", "design.svg", "--json", "design.json"]
    sizes = ["--robots", "1-2", "--lifts", "1-2", "--compartments", "1-2"]
    counts = Path("counts.csv")
    counts.write_text("hour,arrivals,departures\n7,14,0\n8,4,12\n", encoding="utf-8")
    words = ["design", "small", "--counts", "counts.csv", "--wait", "230", "--days", "2", "--no-plant", "--jobs", "1"]
    assert main([*words, *sizes, *files]) == 0
    told = json.loads(Path("design.json").read_text(encoding="utf-8"))
    out = capsys.readouterr().out
    assert "<- fewest" in out and "bottleneck: " in out and "bus-sim run winner.toml" in out
    site = find_site("winner.toml")
    assert isinstance(site, CarPark)
    size = size_of(site)
    assert told["winner"] == size._asdict() and size < Size(2, 2, 2)
    assert Path("design.svg").read_text(encoding="utf-8").startswith("<svg ")
    assert main(["run", "winner.toml", "--one-car", "30", "--no-web", "--trace", "a.log"]) == 0


def test_where_none_keeps_the_target_the_status_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "level1", "--wait", "10", "--days", "1", "--no-plant", "--jobs", "1"]) == 1
    assert "none keeps 95 % of waits within 10 s; give wider ranges" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        (["--robots", "3-1"], "--robots 3-1: must be a number from 1 to 100, or first and last such as 2-6"),
        (["--lifts", "a"], "--lifts a: must be a number from 0 to 64"),
        (["--compartments", "0-2"], "--compartments 0-2: must be a number from 1"),
        (["--robots", "1-100", "--compartments", "1-100"], "10000 sizes; give ranges of 2000 at most"),
        (["--wait", "0"], "--wait 0: must be above 0 s"),
        (["--wait", "nan"], "--wait nan: must be above 0 s"),
        (["--fill", "-1"], "--fill -1: must be above 0 h"),
        (["--days", "0"], "--days 0: must be from 1 to 250"),
        (["--unseen", "3", "--no-plant"], "leave --no-plant out"),
        (["--prices", "1", "-1", "1"], "--prices -1: must be 0 or more"),
        (["--jobs", "-1"], "--jobs -1: must be 1 or more"),
        (["--sessions", "no.csv"], "no.csv"),
        (["--out", "nowhere/winner.toml"], "--out nowhere/winner.toml: there is no folder nowhere"),
        (["--draw", "nowhere/a.svg"], "--draw nowhere/a.svg: there is no folder nowhere"),
    ],
)
def test_a_mistake_gives_one_line(options: list[str], remedy: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "small", "--wait", "200", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("bus-sim: ")
    assert remedy in line


def test_another_system_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "graph", "--wait", "200"]) == 2
    assert "only car parks are designed; name a car park" in capsys.readouterr().err


def test_too_few_days_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(table(tmp_path, 4))
    assert main(["design", "small", "--wait", "200", "--sessions", file, "--unseen", "4"]) == 2
    assert "--unseen 4: the table has 4 working days" in capsys.readouterr().err

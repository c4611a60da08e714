"""Scenario files: written and read back, and every mistake told with its line."""

from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario, load_scenario
from bus_sim.run import FLEET
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from onboard.config.problems import ConfigError


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    faults = (
        parse_injection("crash:target=MR1,at_s=80.5,journal=torn"),
        parse_injection("omission:receivers=11|12,probability=0.25,id=0x100:0x7F0"),
        parse_injection("partition:members=MR1|ER1,at_s=3,for_s=2.5"),
    )
    scenario = FaultScenario("small", 7, 3600.0, Arrivals(3, 100.0, 20.0, 60.0), faults)
    path = tmp_path / "one.toml"
    path.write_text(scenario.to_toml("found by chance"), encoding="utf-8")
    read, site = load_scenario(path)
    assert read == scenario
    assert site.name == "small"


def test_all_mistakes_are_told_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(
        '[scenario]\nsite = "smal"\nsede = 3\n[demand]\ncars = -1\n\n[[fault]]\nkind = "crush"\n[more]\n',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    told = str(caught.value).splitlines()
    assert [line.partition(": ")[0].removeprefix(f"{path}:").partition(" ")[0].rstrip(":") for line in told] == [
        "1",
        "1",
        "4",
        "7",
        "9",
    ]
    assert any('scenario.sede = 3: is no setting; did you mean "seed"?' in line for line in told)
    assert any("demand.cars = -1: has the wrong value; must be a whole number from 0" in line for line in told)
    assert any('did you mean "crash"?' in line for line in told)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "does not exist; name an existing scenario file"),
        ("[scenario", "not TOML: "),
        ("seed = 1\n", "scenario.site: is missing"),
        ('[scenario]\nsite = "small"\n[[fault]]\nkind = "pause"\ntarget = "MR7"\nat_s = 1\n', "no such machine"),
        (
            '[scenario]\nsite = "small"\nlimit_s = inf\n',
            "limit_s = inf: has the wrong value; must be a number above 0, and",
        ),
        ('[scenario]\nsite = "graph"\n[orders]\ncount = 99999999\n', "orders 99999999: must be from 0 to 10000"),
        ('[scenario]\nsite = "small"\n[demand]\ncars = 99999999\n', "cars 99999999: must be from 0 to 100000"),
        ('[scenario]\nsite = "small"\n[fault]\nkind = "pause"\n', "write [[fault]] for each"),
    ],
)
def test_a_mistake_ends_the_command_with_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str | None, told: str
) -> None:
    path = tmp_path / "one.toml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    assert main(["run", "--scenario", str(path)]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert str(path) in error


def test_options_that_the_file_decides_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "small", "--scenario", str(tmp_path / "one.toml")]) == 2
    assert "SITE: does not go with --scenario" in capsys.readouterr().err


def test_a_scenario_is_played_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, trace, figures = tmp_path / "one.toml", tmp_path / "one.log", tmp_path / "one.json"
    text = FaultScenario(
        "small", 1, 900.0, Arrivals(cars=1), (parse_injection("lossy:receivers=MR1,at_s=5"),)
    ).to_toml()
    path.write_text(text, encoding="utf-8")
    assert main(["run", "--scenario", str(path), "--trace", str(trace), "--json", str(figures)]) == 0
    told = capsys.readouterr().out
    assert "fault        lossy:receivers=MR1,at_s=5" in told
    assert "outcome      served" in told
    assert trace.stat().st_size > 0
    assert '"verdict": "served"' in figures.read_text(encoding="utf-8")
    with_devices = tmp_path / "devices.log"
    assert main(["run", "--scenario", str(path), "--trace", str(with_devices), "--devices"]) == 0
    lines = with_devices.read_text(encoding="ascii").splitlines(keepends=True)
    assert {one.split()[1] for one in lines} == {FLEET, *(one.name for one in find_site("small").machines.values())}
    assert "".join(one for one in lines if one.split()[1] == FLEET) == trace.read_text(encoding="ascii")

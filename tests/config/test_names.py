"""Names of shipped sites work wherever a site file does, and a wrong name is one line with the nearest."""

from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from bus_sim.sites import layout_names, site_names
from deploy.cli import main as deploy
from onboard.cli import main as onboard
from onboard.config.shipped import shipped_sites, site_source

NO_BUS = ("-i", "socketcan", "-c", "no-such-interface")
#: Every command that takes a site, and what it then says or does that shows that the site was read.
COMMANDS = [
    ("trace", "dump", "LOG", "--decode", "--site", "NAME"),
    ("trace", "check", "LOG", "--site", "NAME"),
    ("trace", "calls", "LOG", "--site", "NAME"),
    ("trace", "why", "LOG", "IOC1/1", "--site", "NAME"),
    ("trace", "diagram", "LOG", "--site", "NAME", "--out", "x.svg"),
    ("trace", "sequence", "LOG", "IOC1/1", "--site", "NAME"),
    ("trace", "load", "LOG", "--site", "NAME"),
    ("trace", "replay", "LOG", "--machine", "MR1", "--site", "NAME"),
    ("trace", "dissector", "NAME"),
    ("operate", "status", "--site", "NAME", *NO_BUS),
    ("conform", "--node", "11", "--kind", "robot", "--site", "NAME", *NO_BUS),
    ("gateway", "--mqtt", "mqtt://127.0.0.1:1", "--site", "NAME", *NO_BUS),
    ("web", "LOG", "--site", "NAME", "--web", "no-host-of-this-name.invalid:1"),
]


def test_every_shipped_site_is_found_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert list(shipped_sites()) == sorted([*site_names(), *layout_names()])
    assert site_source(Path("small"))[1] == "small.toml"


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: " ".join(words[:2]))
def test_every_command_takes_the_name_of_a_shipped_site(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "one.log"
    log.write_text("(1563926400.000000) fleet 04200001#0000000000000000\n")

    def told(name: str) -> tuple[int, str]:
        status = onboard([{"NAME": name, "LOG": str(log)}.get(word, word) for word in words])
        return status, capsys.readouterr().err

    status, mistake = told("smal")
    assert status == 2
    assert mistake == (
        "smal: no such file, and no such shipped site; name a site file, or a shipped site; "
        'did you mean "small"?\n'
    )  # fmt: skip
    assert "no such file" not in told("small")[1]


def test_the_files_for_boards_are_made_from_a_shipped_site(tmp_path: Path) -> None:
    assert deploy(["machines", "small", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "MR1" / "site.toml").read_text().startswith("# A small robotized car park")


def test_the_simulator_finds_them_as_well(capsys: pytest.CaptureFixture[str]) -> None:
    assert bus_sim(["sites", "small"]) == 0
    assert "places: 59" in capsys.readouterr().out

"""What `bus-sim sites` tells and draws of a floor; every mistake of its ways at once."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from bus_sim.cli import main
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.config.site_report import site_report
from onboard.systems.mapd.building import draw
from tests.mapd.sites import made, site_text

TASKS = [(0, "1,2", "3,5")]
NETWORK = """
[site]
system = "mapd"
name = "line"
[network]
points = ["A", "B", "C", "D"]
lines = [["A", "B", 2], ["B", "C", 3, "one-way"], ["C", "D", 1], ["D", "B", 2]]
zones = [["C"]]
[[desks]]
name = "Desk"
node = 1
[[robots]]
name = "R1"
node = 11
home = "A"
[demand]
endpoints = ["B", "D"]
tasks = []
"""


def test_a_map_is_told_with_what_was_proved() -> None:
    assert site_report(made(2, TASKS)) == [
        "floor: 10 by 5 cells, 42 free",
        "machines: 2 robots (R1, R2), 1 order desk (Desk)",
        "endpoints: 6, 1 task",
        "reached: every endpoint from every home, and every home from every endpoint",
        "rests: 8 robots at the same time, and the others still get everywhere; 2 robots here",
    ]


def test_a_network_is_told_with_its_zones() -> None:
    assert site_report(parse_site(NETWORK, "n.toml"))[0] == "floor: 4 points, 4 lines, 8 cells, 1 zone"


def test_a_map_is_drawn_square_by_square(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site_file, file = tmp_path / "made.toml", tmp_path / "made.svg"
    site_file.write_text(site_text(2, TASKS), encoding="utf-8")
    assert main(["sites", str(site_file), "--draw", str(file)]) == 0
    assert "rests: 8 robots" in capsys.readouterr().out
    drawing = ElementTree.fromstring(file.read_text(encoding="utf-8"))
    fills = [one.attrib["fill"] for one in drawing.iter("{http://www.w3.org/2000/svg}polygon")]
    assert len(fills) == 42 + 2, "each free cell, and each robot"
    assert fills.count("#E69F00") == 6


def test_a_network_is_drawn_with_its_one_way_lines() -> None:
    drawing = ElementTree.fromstring(str(draw(parse_site(NETWORK, "n.toml"))))  # type: ignore[arg-type]  # a floor
    tips = [one for one in drawing.iter("{http://www.w3.org/2000/svg}polygon") if one.attrib["fill"] == "#9a9a9a"]
    assert len(tips) == 3, "one for each step of the one-way line"


def test_every_endpoint_and_home_without_a_way_is_a_line() -> None:
    text = site_text(2, TASKS).replace("r........r", "r@......@r")
    with pytest.raises(ConfigError) as caught:
        parse_site(text.replace("..e@@e@@..", ".@e@@e@@@."), "made.toml")
    lines = str(caught.value).splitlines()
    assert sum("endpoints" in line and "no way from and to 0,0; join them" in line for line in lines) == 6
    assert any('robots[1] = "0,9": no way from and to 0,0; join them' in line for line in lines)


def test_every_home_that_shuts_others_in_is_a_line() -> None:
    text = site_text(2, TASKS).replace('"0,0"', '"0,4"').replace('"0,9"', '"2,3"')
    rows = '["@@@@.@", "......", "@@@.@@"]'
    text = text[: text.index("rows = ")] + f"rows = {rows}\n" + text[text.index("\n[[desks]]") :]
    text = text.replace('"2,3"', '"1,3"').replace('"0,4"', '"1,1"')
    text = text[: text.index("endpoints = ")] + 'endpoints = ["1,0", "1,5"]\ntasks = []\n'
    with pytest.raises(ConfigError) as caught:
        parse_site(text, "made.toml")
    assert [line.split(" ", 1)[1] for line in str(caught.value).splitlines() if "shut others in" in line] == [
        f'robots[{number}] = "{home}": node {node} at home would shut others in; '
        "let it live where nobody must pass, or have fewer robots"
        for number, (node, home) in enumerate({11: "1,1", 12: "1,3"}.items())
    ]

"""What `bus-sim sites` tells and draws of a factory graph; every mistake of its ways at once."""

import re
from math import dist
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bus_sim.cli import main
from bus_sim.sites import find_site
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.config.site_report import site_report
from onboard.systems.graph.building import draw
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph
from tests.graph.sites import hall, site_text


def test_the_shipped_graph_is_told_with_what_was_proved() -> None:
    assert site_report(find_site("graph")) == [
        "nodes: 8, 12 edges of 6 to 10 m, in all 96 m",
        "machines: 3 robots (R1, R2, R3), 2 hosts (NA, NB), 1 order desk (OD)",
        "reached: every node, whichever edge a robot comes by, though none reverses",
        "rests: 24 robots at the same time: 3 in each of 8 nodes, whose last slot is for who passes or visits; "
        "3 robots here",
    ]


def test_rules_without_slots_let_any_number_rest() -> None:
    site = parse_site(site_text(hall(), (0, 8), [], Rules.PAPER), "g.toml")
    assert site_report(site)[-1] == "rests: any number in a node, as the rules paper grant no slots; 2 robots here"


def test_the_drawing_has_every_node_edge_and_robot_and_its_bar_tells_the_scale(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "graph.svg"
    assert main(["sites", "graph", "--draw", str(file)]) == 0
    assert f"drawn: {file}" in capsys.readouterr().out
    drawing = ElementTree.fromstring(file.read_text(encoding="utf-8"))
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    words = [one.text for one in drawing.iter("{http://www.w3.org/2000/svg}text")]
    assert {f"N{node}" for node in site.graph.nodes} | {"R1", "R2", "R3", "5 m"} <= set(words)
    lines = [one.attrib["points"] for one in drawing.iter("{http://www.w3.org/2000/svg}polyline")]
    bar_px, *edges_px = [_length(points) for points in lines]
    off = next(int(found[1]) for one in words if one and (found := re.search(r"at most (\d+) %", one)))
    for drawn_px, length_mm in zip(edges_px, site.graph.lengths_mm.values(), strict=True):
        assert drawn_px / bar_px * 5_000 == pytest.approx(length_mm, rel=(off + 1) / 100)


def test_a_triangle_is_drawn_to_scale() -> None:
    text = site_text(hall(), (0, 8), [], Rules.KEEP)
    edges = "edges = [[0, 1, 3000], [1, 2, 4000], [0, 2, 5000]]\n"
    text = re.sub(r"edges = .*\n", edges, text)
    text = re.sub(r"nodes = \[.*\]", "nodes = []", text).replace("nodes = []", "nodes = [0, 1, 2]", 1)
    site = parse_site(text.replace("at = 8", "at = 2"), "g.toml")
    assert isinstance(site, FactoryGraph)
    assert "off by at most 0 %" in str(draw(site))


def test_every_part_that_is_cut_off_is_a_line() -> None:
    text = site_text(hall(), (0, 8), [], Rules.KEEP)
    islands = ", ".join(f"[{n}, {n + 1}, 900], [{n + 1}, {n + 2}, 900], [{n}, {n + 2}, 900]" for n in (20, 30))
    with pytest.raises(ConfigError) as caught:
        parse_site(text.replace("[0, 1, 6000]", f"[0, 1, 6000], {islands}", 1), "g.toml")
    lines = [line for line in str(caught.value).splitlines() if "cannot be reached" in line]
    assert len(lines) == 2
    assert "= 20: cannot be reached from node 0, nor can 21, 22; join them by an edge" in lines[0]


def _length(points: str) -> float:
    start, end = (tuple(map(float, point.split(","))) for point in points.split())
    return dist(start, end)

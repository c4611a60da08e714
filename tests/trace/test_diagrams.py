"""Each system's diagram over time: what its messages say is where it says, and a system without one is refused."""

import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import pytest

from bus_sim.sites import find_site
from onboard.contract.cell import ArmPhase, ArmProgress
from onboard.contract.graph import RobotAt
from onboard.contract.mapd import StepState
from onboard.contract.terminal import LaneState, StepReport, StepResult
from onboard.contract.turning import LathePhase, LatheProgress
from onboard.systems.cell.diagram import CellDiagram
from onboard.systems.cell.site import Cell
from onboard.systems.graph.diagram import GraphDiagram
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.mapd.diagram import MapdDiagram
from onboard.systems.mapd.site import Mapd
from onboard.systems.terminal.diagram import TerminalDiagram
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.systems.turning.diagram import TurningDiagram
from onboard.systems.turning.site import Turning
from onboard.trace.chart.over_time import Rows
from onboard.trace.cli import main
from onboard.trace.listener import LoggedMessage
from tests.web.logs import file_of, log_of, said_in

_SVG = "{http://www.w3.org/2000/svg}"
#: What stands beside the rows of each system's picture, and the least number of lines and areas in it.
PICTURES = {
    "small": (["p(1,5)", "lift ER1", "MR1", "MR2"], 10, 20),
    "graph": (["N0", "N7", "R1", "R3"], 3, 5),
    "terminal": (["L11", "A4", "S10", "R1", "R4", "blocked"], 30, 30),
    "turning": (["L1", "L3", "order 1, 6 x pin"], 3, 4),
    "cell": (["GM", "R1", "R5", "part 1"], 4, 10),
    "mapd": (["columns", "rows", "R1"], 8, 2),
}


@pytest.mark.parametrize("name", PICTURES)
def test_every_system_draws_what_moves_over_time(name: str, tmp_path: Path) -> None:
    out = tmp_path / "one.svg"
    assert main(["diagram", str(log_of(name)), "--site", str(file_of(name)), "--out", str(out)]) == 0
    root = ET.parse(out).getroot()
    names, lines, areas = PICTURES[name]
    texts = {one.text for one in root.iter(f"{_SVG}text")}
    assert not set(names) - texts
    drawn = [one for one in root.iter(f"{_SVG}polyline") if float(one.get("stroke-width", "0")) > 1]
    assert len(drawn) >= lines and len(list(root.iter(f"{_SVG}polygon"))) >= areas


def _watched(diagram: Rows, name: str) -> Rows:
    for time_us, is_fleet, message in said_in(name):
        if is_fleet:
            diagram.feed(LoggedMessage(time_us, "fleet", message, is_fleet))
    diagram.draw(0)
    return diagram


def _points(diagram: Rows, node: int, panel: int = 0) -> set[tuple[int, float]]:
    return {point for line in diagram.panels[panel].lines if line.node == node for point in line.points}


def test_robots_of_a_graph_are_in_the_rows_of_their_nodes() -> None:
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    diagram = _watched(GraphDiagram(site, None, None), "graph")
    rows = list(diagram.panels[0].rows)
    arrived = [(us, one) for us, _, one in said_in("graph") if isinstance(one, RobotAt) and not one.on_edge]
    assert len({one.node for _, one in arrived}) > 4
    for time_us, one in arrived:
        assert (time_us, rows.index(f"N{one.node}")) in _points(diagram, one.sender)


def test_vehicles_of_a_terminal_pass_lanes_from_end_to_end_while_they_hold_them() -> None:
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    panel = _watched(TerminalDiagram(site, None, None), "terminal").panels[0]
    lanes = [line for line in panel.lines if line.points[0][1] != line.points[1][1]]
    done = {
        (one.sender, one.at_ms)
        for _, _, one in said_in("terminal")
        if isinstance(one, StepReport)
        and one.result is StepResult.DONE
        and site.entities[one.entity].kind is EntityKind.LANE
    }
    assert len(lanes) == len(done)
    for line in lanes:
        (begin_us, begin), (end_us, end) = line.points
        held = [bar for bar in panel.bars if bar.node == line.node and begin <= (bar.low + bar.high) / 2 <= end]
        assert any(bar.begin_us <= begin_us <= bar.end_us for bar in held)
        assert any(bar.begin_us <= end_us <= bar.end_us for bar in held)
    blocked = [bar for bar in panel.bars if not bar.node]
    told = [us for us, _, one in said_in("terminal") if isinstance(one, LaneState) and one.blocked]
    assert [bar.begin_us for bar in blocked] == [min(told)]


def test_lathes_are_at_one_order_at_a_time_as_they_say() -> None:
    site = find_site("turning")
    assert isinstance(site, Turning)
    panel = _watched(TurningDiagram(site, None, None), "turning").panels[0]
    for node in site.lathes:
        bars = sorted((bar.begin_us, bar.end_us) for bar in panel.bars if bar.node == node)
        assert all(one[1] <= two[0] for one, two in pairwise(bars))
    turning = [(us, one) for us, _, one in said_in("turning") if isinstance(one, LatheProgress)]
    assert any(one.lathe_phase is LathePhase.TURNING for _, one in turning)
    for time_us, one in turning:
        if one.lathe_phase in (LathePhase.SETTING_UP, LathePhase.TURNING):
            words = f"order {one.task}, "
            at = [bar for bar in panel.bars if bar.node == one.sender and bar.begin_us <= time_us <= bar.end_us]
            assert any(bar.text.startswith(words) for bar in at)


def test_arms_carry_where_they_say_and_parts_go_from_arm_to_arm() -> None:
    site = find_site("cell")
    assert isinstance(site, Cell)
    panel = _watched(CellDiagram(site, None, None), "cell").panels[0]
    carrying = [(us, one) for us, _, one in said_in("cell") if isinstance(one, ArmProgress)]
    for time_us, one in carrying:
        bars = [bar for bar in panel.bars if bar.node == one.sender and bar.begin_us <= time_us < bar.end_us]
        if one.arm_phase is ArmPhase.CARRYING:
            assert [bar.text.split()[0] for bar in bars] == ["part"]
        elif one.arm_phase in (ArmPhase.IDLE, ArmPhase.WAITING):
            assert not bars
    assert max(len({row for _, row in line.points}) for line in panel.lines) > 2


def test_robots_of_a_floor_are_in_the_columns_and_rows_of_their_cells() -> None:
    site = find_site(str(file_of("mapd")))
    assert isinstance(site, Mapd)
    diagram, wide = _watched(MapdDiagram(site, None, None), "mapd"), len(site.rows[0])
    for time_us, is_fleet, one in said_in("mapd"):
        if is_fleet and isinstance(one, StepState):
            assert (time_us, one.cell % wide) in _points(diagram, one.sender)
            assert (time_us, one.cell // wide) in _points(diagram, one.sender, panel=1)


def test_a_system_without_a_picture_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("onboard.trace.commands.charts.part", lambda system, noun: None)
    out = tmp_path / "one.svg"
    assert main(["diagram", str(log_of("graph")), "--site", str(file_of("graph")), "--out", str(out)]) == 2
    assert "graph, and nobody has said what to draw of one over time" in capsys.readouterr().err
    assert not out.exists()

"""Pictures of a run: the steps of an entry in their order, and lines and bands where the machines were."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from onboard.contract.messages import Progress, Reference
from onboard.systems.car_park.diagram import TrackDiagram, watch
from onboard.trace.chart.sequence import SequenceChart, chart
from onboard.trace.cli import main
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log
from onboard.ways.site import way_site
from onboard.wire.codec import codecs
from tests.tools import require_tool
from tests.trace.runs import SITE, SITE_FILE, fleet_of, key_log, run_log

_SVG = "{http://www.w3.org/2000/svg}"
_PANEL_NAMES_X = 8


def _chart(number: int = 1, path: Path | None = None) -> SequenceChart:
    with Log(str(path or run_log())) as log:
        found = chart(SITE, Listener(codecs()).messages(log), Reference(1, number))
    assert found is not None
    return found


def _picture() -> TrackDiagram:
    return watch(SITE, fleet_of(run_log()))


def test_the_steps_of_an_entry_are_numbered_in_the_order_of_the_figure() -> None:
    arrows = _chart(path=key_log()).arrows
    first = {step: min(one.time_us for one in arrows if one.step == step) for step in {one.step for one in arrows}}
    # Fig. 9 has 5 and 6 before the bids; the output door waits for the locked input door and the robot (flag 5), and
    # this robot takes its lift before it loads. Step 1 comes before the call, and so does the story. The itinerary is
    # told with the award, not in step 9, and tells the lift of its ride, which is step 15.
    order = [1, 2, 5, 3, 7, 10, 11, 12, 6, 13, 14, 21]
    assert [first[step] for step in order] == sorted(first[step] for step in order)
    assert arrows[0].step == 1 and arrows[-1].step == 21
    assert first[15] == first[11] and 9 not in first


def test_a_chart_holds_the_machines_of_the_task_and_nobody_else(capsys: pytest.CaptureFixture[str]) -> None:
    assert _chart().nodes == [1, 5, 11]
    assert _chart(2).nodes == [1, 5, 6, 12]
    capsys.readouterr()
    assert main(["sequence", str(run_log()), "IOC1/1", "--site", str(SITE_FILE)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["IOC1", "ER1", "MR1"]
    bid = next(line for line in lines if "bids" in line)
    assert re.search(r" 7 <-{20,}\+  bids \d+\.\d{3} s$", bid), bid
    assert lines[-1].endswith("|              |              o  task done, p(1,5)F") and " 21 " in lines[-1]


def test_lines_are_where_the_machines_said_they_are() -> None:
    runs = _picture().runs
    for said in fleet_of(run_log()):
        if isinstance(said.message, Progress):
            place = said.message.index - 1 + said.message.offset_mm / way_site(SITE).tracks[said.message.track].pitch_mm
            assert any(
                (node, track) == (said.message.sender, said.message.track) and (said.time_us, place) == point[:2]
                for node, track, points in runs
                for point in points
            )


def test_machines_stand_inside_their_authority_and_authority_has_one_holder() -> None:
    picture = _picture()
    assert {band.node for band in picture.authority} == {11, 12}
    assert {band.node for band in picture.reservations} == {11, 12}
    for number, band in enumerate(picture.authority):
        for other in picture.authority[number + 1 :]:
            same = (band.track, band.begin) == (other.track, other.begin) and band.node != other.node
            assert not same or band.end_us <= other.begin_us or other.end_us <= band.begin_us
    # Where a robot enters a segment under way it holds it.
    for said in fleet_of(run_log()):
        message = said.message
        if isinstance(message, Progress) and message.sender == 11 and message.speed_mm_s and 1 <= message.index <= 10:
            place = message.index - 1.0
            assert any(
                band.node == 11 and band.track == message.track and band.begin[0] <= place <= band.begin[1]
                and band.begin_us <= said.time_us <= band.end_us
                for band in picture.authority
            ), said  # fmt: skip


def test_the_diagram_is_svg_with_a_panel_for_every_track(tmp_path: Path) -> None:
    out = tmp_path / "run.svg"
    assert main(["diagram", str(run_log()), "--site", str(SITE_FILE), "--out", str(out)]) == 0
    root = ET.parse(out).getroot()
    # The names of panels stand at the left; those of a lift's floors beside it.
    assert [one.text for one in root.iter(f"{_SVG}text") if float(one.get("x", "0")) == _PANEL_NAMES_X] == [
        *("floor 3", "floor 2", "floor 1", "lift ER1", "lift ER2")
    ]
    notes = {one.text for one in root.iter(f"{_SVG}title")}
    assert {"MR1: reserved", "MR1: authority", "MR2: reserved", "MR2: authority"} <= notes
    strokes = {one.get("stroke") for one in root.iter(f"{_SVG}polyline")}
    assert len(strokes) >= 5, "each machine and the grid has a colour of its own"


def test_a_part_of_the_time_and_png(tmp_path: Path) -> None:
    require_tool("rsvg-convert")
    out = tmp_path / "part.png"
    words = ["--from", "20", "--until", "100", "--out", str(out)]
    assert main(["diagram", str(run_log()), "--site", str(SITE_FILE), *words]) == 0
    data = out.read_bytes()
    assert data.startswith(b"\x89PNG\r\n") and int.from_bytes(data[16:20], "big") == 1200
    chart_file = tmp_path / "entry.svg"
    assert main(["sequence", str(run_log()), "IOC1/1", "--site", str(SITE_FILE), "--out", str(chart_file)]) == 0
    assert "[21] task done" in chart_file.read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["diagram", "--out", "x.gif"], "x.gif: name a file that ends in .svg or .png"),
        (["diagram", "--from", "9000", "--out", "x.svg"], "nothing of"),
        (["sequence", "IOC1/77"], "no call for task IOC1/77 in it"),
    ],
)
def test_a_mistake_is_one_clear_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(run_log())
    capsys.readouterr()
    assert main([words[0], log, *words[1:], "--site", str(SITE_FILE)]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1

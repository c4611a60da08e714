"""What a run of each system leaves is judged, told and drawn by the ordinary commands, in words of the system."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from onboard.cli import main as onboard
from tests.conformance.case import Case
from tests.conformance.cases import every_system
from tests.conformance.runs import log_of, site_file

_SVG = "{http://www.w3.org/2000/svg}"
#: Words of a car park, and its way of writing places: nobody else's.
FOREIGN = re.compile(r"\bcars?\b|\bp\(\d")


@pytest.fixture
def told(case: Case, capsys: pytest.CaptureFixture[str]) -> "Told":
    return Told(case, capsys)


class Told:
    """What ``onboard trace`` says of a system's log."""

    def __init__(self, case: Case, capsys: pytest.CaptureFixture[str]) -> None:
        self.log, self.site, self._capsys = str(log_of(case.system)), site_file(case.system), capsys
        capsys.readouterr()

    def __call__(self, command: str, *words: str, status: int = 0) -> str:
        assert onboard(["trace", command, self.log, *words, "--site", self.site]) == status
        return self._capsys.readouterr().out


@every_system
def test_a_log_is_judged_by_the_rules_of_its_system(case: Case, told: Told) -> None:
    verdict = told("check")
    assert "BROKEN" not in verdict
    for rule in {*case.broken, *case.broken_in}:
        assert any(line.split()[:1] == [rule] for line in verdict.splitlines()), rule


@every_system
def test_a_log_is_told_in_the_words_of_the_system(case: Case, told: Told) -> None:
    calls, tasks = told("calls"), told("why")
    reports = "".join(told("why", line.split()[0]) for line in tasks.splitlines()[:4])
    sequence, dump = told("sequence", tasks.split()[0]), told("dump", "--decode")
    for text, wanted in zip((calls, tasks + reports, dump), case.words, strict=True):
        assert [word for word in wanted if word not in text] == []
    if case.system != "car-park":
        lines = [line for text in (calls, reports, sequence, dump) for line in text.splitlines()]
        assert [line for line in lines if FOREIGN.search(line)] == []


@every_system
def test_what_moves_is_drawn_over_time_or_refused_with_the_reason(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, site = tmp_path / "one.svg", site_file(case.system)
    status = onboard(["trace", "diagram", str(log_of(case.system)), "--site", site, "--out", str(out)])
    if not case.drawn:
        assert (status, out.exists()) == (2, False)
        assert "has no diagram over time" in capsys.readouterr().err
        return
    assert status == 0
    root = ET.parse(out).getroot()
    assert not set(case.drawn) - {one.text for one in root.iter(f"{_SVG}text")}
    moving = [one for one in root.iter(f"{_SVG}polyline") if float(one.get("stroke-width", "0")) > 1]
    assert len(moving) >= 3


@every_system
def test_figures_are_of_a_run_in_which_nothing_broke(case: Case) -> None:
    figures = json.loads(log_of(case.system).with_suffix(".json").read_text(encoding="utf-8"))
    assert not figures["violations"] and not figures["halted"]
    assert figures["frames"] > 100


def test_without_a_site_loads_are_neutral(capsys: pytest.CaptureFixture[str]) -> None:
    log = str(log_of("car-park"))
    capsys.readouterr()
    assert onboard(["trace", "calls", log]) == 0
    calls = capsys.readouterr().out
    assert "park load node 1/1, task node 1/1" in calls and not re.search(r"\bcar\b", calls)

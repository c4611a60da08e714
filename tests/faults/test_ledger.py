"""Campaigns add up in a file: what was played under the same state of the program is not played again."""

import json
from pathlib import Path

import pytest

from bus_sim.campaign.ledger import Ledger, state
from bus_sim.campaign.report import FAILURES, RunVerdict
from bus_sim.cli import main
from bus_sim.demand import DemandError

SEEDS = "campaign level1 --cars 1 --faults two-crashes --no-baseline --jobs 1 --limit 900 --seeds"


def read(path: Path, campaign: str) -> Ledger[RunVerdict]:
    return Ledger.read(path, campaign, RunVerdict, FAILURES)


def test_a_campaign_goes_on_where_its_file_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*SEEDS.split(), "1-2", "--add-to", "all.jsonl"]) == 0
    assert main([*SEEDS.split(), "1-3", "--add-to", "all.jsonl"]) == 0
    told = capsys.readouterr().out
    assert "2 runs" in told
    assert "1 runs" in told
    assert f"3 runs of state {state()}" in told.replace("\n", "")
    lines = [json.loads(line) for line in (tmp_path / "all.jsonl").read_text().splitlines()]
    assert [one["number"] for one in lines] == [1, 2, 3]


def test_results_of_another_state_or_campaign_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    read(path, "one").add(7, RunVerdict.SERVED, "")
    path.write_text(path.read_text() + path.read_text().replace(state(), "old"))
    assert read(path, "other").open_of([7]) == [7]
    ledger = read(path, "one")
    assert (ledger.open_of([7, 8]), ledger.others) == ([8], 1)


def test_a_failure_of_before_still_fails_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    read(path, "one").add(7, RunVerdict.HUNG, "why")
    ledger = read(path, "one")
    assert ledger.has_failed
    assert any("7: hung: why" in line for line in ledger.lines())


def test_a_file_that_is_no_ledger_is_told(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    path.write_text("once upon a time\n")
    with pytest.raises(DemandError, match="--add-to"):
        read(path, "one")

"""Logs as tables: what is in them is what the messages say, and the queries of docs/trace.md give what they promise."""

import builtins
import re
from collections import Counter
from pathlib import Path
from typing import Any

import duckdb
import pytest

from onboard.contract.codes import CallResult, TaskPhase
from onboard.contract.messages import Award, Bid, Heartbeat, ManualState, Message, TaskReport, TokenRefusal
from onboard.core.frame import Frame
from onboard.trace.candump import format_line
from onboard.trace.cli import main
from onboard.trace.columns import parquet
from onboard.wire.codec import codecs
from tests.trace.runs import SITE, SITE_FILE, fleet_of, run_log

TEXT = (Path(__file__).parents[2] / "docs" / "trace.md").read_text(encoding="utf-8")
QUERIES = re.findall(r"([^\n]+):\n\n```sql\n(.*?)```", TEXT, re.DOTALL)


@pytest.fixture
def tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(run_log()), "--parquet", "tables", "--site", str(SITE_FILE)]) == 0
    return tmp_path / "tables"


def _rows(query: str) -> list[tuple[Any, ...]]:
    return duckdb.connect().execute(query).fetchall()


def _answer(title: str) -> list[tuple[Any, ...]]:
    return _rows(next(query for name, query in QUERIES if name.startswith(title)))


def test_every_query_of_the_page_has_an_answer(tables: Path) -> None:
    assert len(QUERIES) == 6
    for title, query in QUERIES:
        assert _rows(query), title


def test_the_answers_are_those_of_the_messages(tables: Path) -> None:
    messages = [said.message for said in fleet_of(run_log())]
    names = {machine.node_id: machine.name for machine in SITE.machines.values()}
    bids = Counter(names[one.sender] for one in messages if isinstance(one, Bid))
    won = {
        (one.sender, one.call): one.winner
        for one in messages
        if isinstance(one, Award) and one.result is CallResult.AWARDED
    }
    wins = Counter(
        names[won[one.initiator, one.call]]
        for one in messages
        if isinstance(one, Bid) and won.get((one.initiator, one.call)) == one.sender
    )
    assert {machine: (count, least) for machine, count, least in _answer("Who bids")} == {
        machine: (count, wins[machine]) for machine, count in bids.items()
    }
    refusals = Counter((names[one.sender], one.reason.name) for one in messages if isinstance(one, TokenRefusal))
    assert {(machine, reason): times for machine, reason, times in _answer("What is refused")} == refusals
    done = {
        f"{names[one.task.origin]}/{one.task.number}"
        for one in messages
        if isinstance(one, TaskReport) and one.phase is TaskPhase.DONE
    }
    assert {task for task, _, _ in _answer("How long tasks take")} == done != set()
    said = dict(_answer("What is said"))
    assert said["Heartbeat"] == sum(isinstance(one, Heartbeat) for one in messages)
    assert max(frames for _, frames in _answer("The fullest seconds")) <= sum(said.values())
    assert all(0 < median <= longest for _, _, median, longest in _answer("How long a right"))


def test_a_table_has_the_machines_of_the_site_and_types_of_the_contract(tables: Path) -> None:
    assert _rows("select node, name from 'tables/machines.parquet' order by node") == sorted(
        (machine.node_id, machine.name) for machine in SITE.machines.values()
    )
    types = {name: kind for name, kind, *_ in _rows("describe select * from 'tables/Heartbeat.parquet'")}
    assert types["time_us"] == "BIGINT"
    assert (types["sender"], types["machine"], types["state"]) == ("UTINYINT", "VARCHAR", "VARCHAR")


def _log(path: Path, *messages: Message | Frame) -> Path:
    lines = []
    for number, message in enumerate(messages):
        frames = (message,) if isinstance(message, Frame) else codecs().fleet.encode(message)
        lines += [format_line(number, "can0", frame) for frame in frames]
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def test_without_a_site_machines_are_numbers_and_frames_of_no_contract_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from onboard.contract.codes import ManualMode

    held = [ManualState(11, 1, ManualMode.HELD, at_rest=rest) for rest in (False, True)]
    log = _log(tmp_path / "a.log", *held, Frame(0x123, b"\x01", is_extended=False), Frame(0x18FF0201, bytes(8)))
    assert main(["export", str(log), "--parquet", str(tmp_path / "new" / "tables")]) == 0
    told = capsys.readouterr()
    assert told.out == f"{tmp_path}/new/tables: 2 rows in 1 tables\n"
    assert told.err == f"{log}: frames in no table (unknown identifier): 2\n"
    assert _rows(f"select * from '{tmp_path}/new/tables/ManualState.parquet'") == [
        (0, "can0", 11, 1, "HELD", False),
        (1, "can0", 11, 1, "HELD", True),
    ]


def test_rows_are_written_in_groups_and_none_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parquet, "_GROUP_ROWS", 100)
    monkeypatch.setattr("onboard.trace.readers.open_log._PIECE_BYTES", 4096)
    log = _log(tmp_path / "a.log", *(Bid(11, 1, number, number, 0) for number in range(1_000)))
    assert main(["export", str(log), "--parquet", str(tmp_path / "tables")]) == 0
    assert _rows(f"select call from '{tmp_path}/tables/Bid.parquet'") == [(number,) for number in range(1_000)]


def test_a_folder_that_holds_tables_is_not_written_to(tables: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(run_log()), "--parquet", "tables"]) == 2
    assert capsys.readouterr().err == "onboard trace: tables: holds tables already, or is no folder; name a new one\n"


def test_without_the_libraries_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("onboard.trace.columns"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    log = _log(tmp_path / "a.log", Bid(11, 1, 1, 1, 0))
    assert main(["export", str(log), "--parquet", str(tmp_path / "tables")]) == 2
    told = capsys.readouterr().err
    assert told == "onboard trace: export: its libraries are missing; pip install 'onboard-fleet[parquet]'\n"

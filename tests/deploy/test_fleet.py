"""The folders of a fleet's boards, as somebody gets them who copies them to cards."""

from pathlib import Path

import pytest

from deploy.cli import main


def test_one_wire_for_both_buses_is_refused_where_tickets_would_be_read_on_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``onboard`` refuses such a machine file; whoever makes it is told before a card is written."""
    assert main(["machines", "level1", "--out", str(tmp_path), "--device", "can0"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "tickets at IOC1" in line and "--device" in line
    assert not list(tmp_path.iterdir())


def test_machines_without_tickets_may_have_one_wire(tmp_path: Path) -> None:
    assert main(["machines", "graph", "--out", str(tmp_path), "--device", "can0"]) == 0
    assert all("[device_bus]" not in file.read_text(encoding="utf-8") for file in tmp_path.glob("*/machine.toml"))

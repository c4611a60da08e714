"""The folders of a fleet's boards, as somebody gets them who copies them to cards."""

from pathlib import Path

from deploy.cli import main
from onboard.config.machine import load_machine


def test_on_one_wire_a_desk_still_has_its_own(tmp_path: Path) -> None:
    """``onboard`` refuses a machine file by which its tickets would be read on the fleet bus."""
    assert main(["machines", "level1", "--out", str(tmp_path), "--device", "can0"]) == 0
    desk, robot = (load_machine(tmp_path / name / "machine.toml") for name in ("IOC1", "MR1"))
    assert desk.device_bus != desk.fleet_bus and robot.device_bus == robot.fleet_bus


def test_machines_without_tickets_may_have_one_wire(tmp_path: Path) -> None:
    assert main(["machines", "graph", "--out", str(tmp_path), "--device", "can0"]) == 0
    assert all("[device_bus]" not in file.read_text(encoding="utf-8") for file in tmp_path.glob("*/machine.toml"))

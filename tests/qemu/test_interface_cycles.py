"""Interfaces gone, late and back in the guest: five cycles of the hundred of ``python -m hil.guest.cycles 100``."""

from pathlib import Path

from hil.guest.cycles import play_cycles
from hil.guest.cycles_scene import KINDS
from tests.qemu.guest import require_guest


def test_every_machine_takes_part_again_with_its_rights(tmp_path: Path) -> None:
    require_guest()
    found = play_cycles(tmp_path / "share", 5)
    assert found.faults == [], "\n".join([*found.table(), *found.faults])
    assert {one["kind"] for one in found.cycles} == set(KINDS)
    assert len({one["machine"] for one in found.cycles}) > 1

"""The boards' root file system boots in an emulated machine, survives the loss of its power, and says what is wrong."""

import re
from pathlib import Path

import pytest

from deploy.fleet import write_fleet
from deploy.image.emulate import Board, make_boot_partition, make_journal_partition
from deploy.image.root import Root, build_root

SITE = Path(__file__).parents[1] / "bus_sim" / "sites" / "level1.toml"
#: Emulated on a busy host.
LIMIT_S = 400.0
#: candump's line of MR1's heartbeat (node 11); its sixth byte is the boot counter.
BEAT = re.compile(r"can0 1250000B#[0-9A-F]{10}([0-9A-F]{2})")


def boots(console: str) -> list[int]:
    return [int(found, 16) for found in BEAT.findall(console)]


@pytest.fixture
def partitions(tmp_path: Path) -> tuple[Path, Path]:
    """The partitions of MR1's board: boot with its files, and an empty one for its journal."""
    write_fleet(SITE, tmp_path / "fleet")
    files = [tmp_path / "fleet" / "MR1" / name for name in ("machine.toml", "site.toml")]
    return make_boot_partition(tmp_path / "boot.img", files), make_journal_partition(tmp_path / "journal.img")


def test_it_boots_to_its_heartbeat_and_after_a_power_cut_it_knows_that_this_is_another_life(
    root: Root, partitions: tuple[Path, Path]
) -> None:
    lives = []
    for _ in range(2):
        with Board(root, *partitions) as board:
            board.until("a heartbeat", lambda console: bool(boots(console)), LIMIT_S)
            lives.append(boots(board.console)[0])
    assert lives == [1, 2]


def test_without_a_machine_file_it_is_silent_and_says_why(root: Root, tmp_path: Path) -> None:
    boot, journal = make_boot_partition(tmp_path / "boot.img", []), make_journal_partition(tmp_path / "journal.img")
    with Board(root, boot, journal) as board:
        board.until("the reason", lambda console: "name an existing machine file" in console, LIMIT_S)
        assert "/boot/onboard/machine.toml: does not exist" in board.console
        assert not re.search(r"can\d [0-9A-F]+#", board.console)


def test_built_twice_it_is_the_same(root: Root, tmp_path: Path) -> None:
    assert build_root(tmp_path / "again").digest == root.digest

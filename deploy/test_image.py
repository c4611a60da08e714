"""The image boots in an emulated machine, survives kill, freeze and the loss of its power, and says what is wrong."""

import re
from pathlib import Path

from deploy.image.emulate import Board, personalise
from deploy.image.image import Image, build_image
from deploy.image.release import Release

#: Processor time of the emulator for one thing that is waited for: three times what the slowest takes, a first start.
LIMIT_S = 450.0
#: candump's line of MR1's heartbeat (node 11); its sixth byte is the boot counter.
BEAT = re.compile(r"can0 1250000B#[0-9A-F]{10}([0-9A-F]{2})")


def lives(console: str) -> list[int]:
    """The controller's boot counters in the order in which they were heard."""
    return list(dict.fromkeys(int(found, 16) for found in BEAT.findall(console)))


def written(console: str) -> list[int]:
    return [int(found) for found in re.findall(r"test: record (\d+)\b", console)]


def test_killed_frozen_and_without_power_in_the_middle_of_a_write_it_comes_back(mr1: Path) -> None:
    personalise(mr1, [], "onboard.emulated test.harm")
    with Board(mr1) as board:
        board.until("a heartbeat", lambda console: lives(console) == [1], LIMIT_S)
        board.until("a heartbeat after kill -9", lambda console: lives(console) == [1, 2], LIMIT_S)
        board.until("a heartbeat after a freeze", lambda console: lives(console) == [1, 2, 3], LIMIT_S)
        board.until("journal writes", lambda console: len(written(console)) >= 5, LIMIT_S)
    kept = written(board.console)[-1]
    with Board(mr1) as board:
        board.until("a heartbeat", lambda console: bool(lives(console)), LIMIT_S)
        board.until("the journal", lambda console: "test: found " in console, LIMIT_S)
    assert lives(board.console)[0] == 4
    found = re.search(r"test: found (\d+) records, (\w+)", board.console)
    assert found is not None and int(found[1]) >= kept and found[2] in ("INTACT", "TORN", "MENDED")


def test_without_a_machine_file_it_is_silent_and_says_why(disk: Path) -> None:
    personalise(disk, [])
    with Board(disk) as board:
        board.until("the reason", lambda console: "name an existing machine file" in console, LIMIT_S)
        assert "/boot/onboard/machine.toml: does not exist" in board.console
        assert not re.search(r"can\d [0-9A-F]+#", board.console)


def test_built_twice_it_is_the_same(image: Image, release: Release, tmp_path: Path) -> None:
    again = build_image(tmp_path / "again.img", release)
    assert again.root.digest == image.root.digest
    assert again.digest == image.digest

"""The image boots in an emulated machine, survives the loss of its power, and says what is wrong."""

import re
from pathlib import Path

from deploy.image.emulate import Board, personalise
from deploy.image.image import Image, build_image
from deploy.image.release import Release

#: Emulated on a busy host.
LIMIT_S = 400.0
#: candump's line of MR1's heartbeat (node 11); its sixth byte is the boot counter.
BEAT = re.compile(r"can0 1250000B#[0-9A-F]{10}([0-9A-F]{2})")


def boots(console: str) -> list[int]:
    return [int(found, 16) for found in BEAT.findall(console)]


def test_it_boots_to_its_heartbeat_and_after_a_power_cut_it_knows_that_this_is_another_life(mr1: Path) -> None:
    lives = []
    for _ in range(2):
        with Board(mr1) as board:
            board.until("a heartbeat", lambda console: bool(boots(console)), LIMIT_S)
            lives.append(boots(board.console)[0])
    assert lives == [1, 2]


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

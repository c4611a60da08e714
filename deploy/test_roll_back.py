"""Updates from a stick, in an emulated machine: one cut off by a power cut, a good one, and one that is broken."""

from functools import partial
from pathlib import Path

from deploy.image.boot import make_fat
from deploy.image.emulate import Board
from deploy.image.release import Release
from deploy.image.root import build_root
from deploy.test_image import LIMIT_S, lives
from deploy.update.bundle import write_bundle
from deploy.update.manifest import INITRD, KERNEL, ROOT

#: A controller that ends as soon as it is started.
BROKEN = {"etc/systemd/system/onboard.service.d/broken.conf": b"[Service]\nExecStart=\nExecStart=/bin/false\n"}


def stick(release: Release, secret: Path, to: Path) -> Path:
    """A stick with an update to this release."""
    root = build_root(to / "parts", release)
    file = to / f"{release.version}.update"
    write_bundle(file, {KERNEL: root.kernel, INITRD: root.initrd, ROOT: root.squashfs}, secret, release.version)
    return make_fat(to / f"stick-{release.version}.img", [file], label="UPDATE")


def _has(line: str, console: str) -> bool:
    return line in console


def until(board: Board, *lines: str) -> None:
    for line in lines:
        board.until(line, partial(_has, line), LIMIT_S)


def test_updates_are_tried_kept_and_given_up(mr1: Path, release: Release, secret: Path, tmp_path: Path) -> None:
    good = stick(Release("1.1", release.key), secret, tmp_path)
    broken = stick(Release("1.2", release.key, BROKEN), secret, tmp_path)

    with Board(mr1, [good]) as board:
        until(board, "onboard: starting slot a", "onboard-update: version 1.1 is in order; writing it into slot b")
    with Board(mr1, [good]) as board:
        # Half of it is in slot B, and the board starts slot A.
        until(board, "onboard: starting slot a", "version 1.1 is written, and tried at the next start of this board")
        board.until("a heartbeat", lambda console: bool(lives(console)), LIMIT_S)
    with Board(mr1, [broken]) as board:
        until(board, "onboard: starting slot b", "onboard-update: version 1.1 in slot b is healthy, and stays")
        until(board, "version 1.2 is in order; writing it into slot a", "version 1.2 is written, and tried at the next")
    with Board(mr1) as board:
        until(board, "onboard: starting slot a", "onboard-update: version 1.2 in slot a is not healthy; back to slot b")
        until(board, "onboard: starting slot b", "version 1.2 did not work and is given up; version 1.1 runs again")
        board.until("a heartbeat", lambda console: bool(lives(console)), LIMIT_S)

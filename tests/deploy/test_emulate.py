"""Waiting for what an emulated board says: whole lines, by the emulator's work and not by the wall's clock."""

import os
import sys
from pathlib import Path

import pytest

from deploy.image import emulate
from deploy.image.emulate import Board
from deploy.wheels import DeployError
from hil.guest import effort
from hil.guest.effort import Effort, processor_time_s

LIMIT_S = 60.0


class Stand(Board):
    """A program in the emulator's place."""

    def __init__(self, program: str) -> None:
        super().__init__(Path("disk.img"))
        self._words = [sys.executable, "-u", "-c", program]


def test_half_a_line_says_nothing(tmp_path: Path) -> None:
    """A count that is read before its last digit came would be a smaller one."""
    go_on = tmp_path / "go on"
    os.mkfifo(go_on)
    halves = (
        f"import sys; sys.stdout.write('ready\\r\\nrecord 1'); open({str(go_on)!r}).read(); print('23', flush=True)"
    )
    looks: list[str] = []

    def is_there(console: str) -> bool:
        looks.append(console)
        if "ready" in console and not go_on_written:
            go_on_written.append(go_on.write_text("now"))
        return "record" in console

    go_on_written: list[int] = []
    with Stand(halves) as board:
        board.until("a record", is_there, LIMIT_S)
        assert board.console == "ready\nrecord 123\n"
    assert looks[-2] == "ready\n"


def test_a_board_that_ends_is_told_with_its_last_words() -> None:
    with Stand("print('one'); print('no newline', end='')") as board, pytest.raises(DeployError) as told:
        board.until("more", lambda _: False, LIMIT_S)
    assert str(told.value) == "not on the console: more; it has ended\none\nno newline"


def test_the_limit_is_of_work_done() -> None:
    with Stand("while True: pass") as board, pytest.raises(DeployError, match="it has worked for"):
        board.until("nothing", lambda _: False, 0.2)


def test_who_neither_works_nor_speaks_is_stuck(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(effort, "STILL_S", 0.0)
    monkeypatch.setattr(emulate, "LOOK_S", 0.01)
    with Stand("import signal; signal.pause()") as board, pytest.raises(DeployError, match="neither worked"):
        board.until("anything", lambda _: False, LIMIT_S)


def test_words_and_work_are_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, worked_s = [0.0], [0.0]
    monkeypatch.setattr("hil.guest.effort.time.monotonic", lambda: now_s[0])
    monkeypatch.setattr(effort, "processor_time_s", lambda _: worked_s[0])
    one = Effort(os.getpid(), 1e9)
    for _ in range(3):
        now_s[0] += effort.STILL_S
        worked_s[0] += 1.1
        assert one.why_over(0) is None
    for said in range(1, 4):
        now_s[0] += effort.STILL_S
        assert one.why_over(said) is None
    now_s[0] += effort.STILL_S + 1
    assert one.why_over(3) is not None


def test_processor_time_is_that_of_the_process() -> None:
    used = os.times()
    assert processor_time_s(os.getpid()) == pytest.approx(used.user + used.system, abs=0.5)

"""A person's answer, from whatever stands in a person's place."""

from collections.abc import Iterator
from pathlib import Path
from typing import TextIO, cast

import pytest

from hil.commission.person import ConsolePerson
from onboard.operate.asking import Asker
from onboard.operate.order import OperatorCommand
from onboard.operate.park import Park
from onboard.operate.station import OperatorStation


class Endless:
    """A device that ends no line."""

    def fileno(self) -> int:
        raise OSError("is no terminal")

    def isatty(self) -> bool:
        return True

    def readline(self, size: int) -> str:
        assert 0 < size <= 1_000, "all of it would be held"
        return "y" * size


@pytest.fixture(name="zeros")
def _zeros() -> Iterator[TextIO]:
    with Path("/dev/zero").open(encoding="utf-8") as device:
        yield device


async def test_an_answer_that_does_not_end_is_cut_and_is_no_yes(monkeypatch: pytest.MonkeyPatch, zeros: TextIO) -> None:
    monkeypatch.setattr("sys.stdin", Endless())
    asker = Asker(cast("OperatorStation", None), print)
    assert not await asker.agrees(OperatorCommand(cast("Park", None), 251))
    monkeypatch.setattr("sys.stdin", zeros)
    assert len(await ConsolePerson().ask("go on?")) == 1_000

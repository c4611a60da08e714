"""A person's answer, from whatever stands in a person's place."""

import asyncio
import os
import select
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


async def test_of_an_answer_that_comes_in_pieces_no_more_is_taken_than_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two reads of up to a thousand bytes made an answer of nearly twice as many."""
    out, into = os.pipe()
    # Both ends are open already: neither waits.
    with (
        open(out, encoding="utf-8") as source,  # noqa: ASYNC230, PTH123  # a pipe has no path, and is open
        open(into, "wb", buffering=0) as person,  # noqa: ASYNC230, PTH123  # the same
    ):
        monkeypatch.setattr("sys.stdin", source)
        asked = asyncio.ensure_future(ConsolePerson().ask("go on?"))
        person.write(b"y" * 999)
        while select.select([source], [], [], 0)[0]:  # noqa: ASYNC110  # a pipe tells nobody that it was read
            await asyncio.sleep(0)
        person.write(b"y" * 999)
        assert len(await asked) == 1_000

"""A board in another's place: with its journal it takes part again, without it it holds for a person."""

import asyncio
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from deploy.__main__ import main
from deploy.image.layer import FILES
from onboard.config.machine import load_machine
from onboard.contract.codes import MachineState
from onboard.contract.messages import Heartbeat, Message
from onboard.core.site import journal_owner
from onboard.io.journal import FILE_NAME, FileJournal
from onboard.io.open_bus import BusSettings, open_bus
from tests.io.test_socketcand import free_port
from tests.system.test_cli import Listener
from tests.system.test_late_interface import ended, machine_file, site, start
from tests.tools import DEADLINE_S

TAKING_PART = (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING)


def takes_part(boot: int) -> Callable[[Message], bool]:
    """A heartbeat of MR1 in this life, taking part."""

    def fits(message: Message) -> bool:
        if not isinstance(message, Heartbeat) or message.sender != 11:
            return False
        return message.boot == boot and message.state in TAKING_PART

    return fits


async def test_another_board_goes_on_where_the_dead_one_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port, card = free_port(), tmp_path / "card"
    card.mkdir()
    machine_file(card, port)
    (card / "mr1.toml").rename(card / "machine.toml")
    (card / "mr1.pem").write_text("its key to the broker")
    async with asyncio.timeout(DEADLINE_S):
        fleet = await site(card, port)
        listener = Listener()
        bus = await open_bus(BusSettings("socketcand-asyncio", "fleet", extra=(("host", "127.0.0.1"), ("port", port))))
        bus.subscribe(listener.on_frame)
        old = await start(card, "onboard", "--machine", "machine.toml", "--journal", "journal")
        await listener.until(takes_part(1))
        old.kill()
        await old.communicate()

        words = ["replace", "--card", str(card), "--journal", str(card / "journal"), "--out", str(tmp_path / "new")]
        assert await asyncio.to_thread(main, words) == 0
        assert "records of MR1, in order" in capsys.readouterr().out
        board = tmp_path / "new" / "MR1"
        assert {file.name for file in board.iterdir()} == {"machine.toml", "level1.toml", "mr1.pem", "journal"}
        new = await start(board, "onboard", "--machine", "machine.toml", "--journal", "journal")
        await listener.until(takes_part(2))
        assert await ended(new) == 0
        await bus.close()
        await ended(fleet)


def test_without_a_journal_a_person_is_sent_to_regenerate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine_file(tmp_path, 1)
    (tmp_path / "mr1.toml").rename(tmp_path / "machine.toml")
    assert main(["replace", "--card", str(tmp_path), "--out", str(tmp_path / "new")]) == 0
    assert "it holds until a person has regenerated its rights" in capsys.readouterr().out
    assert not (tmp_path / "new" / "MR1" / "journal").exists()


@pytest.mark.parametrize("damage", ["foreign", "short", "none"])
async def test_a_journal_that_is_not_the_machines_or_not_whole_is_refused(
    damage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    machine_file(tmp_path, 1)
    (tmp_path / "mr1.toml").rename(tmp_path / "machine.toml")
    config = load_machine(tmp_path / "machine.toml")
    owner = "another site node 11" if damage == "foreign" else journal_owner(config.site, config.machine)
    if damage != "none":
        journal = FileJournal(tmp_path / "journal", owner)
        journal.replay()
        for number in range(200):
            await journal.append({"record": "boot", "boot": number})
        await journal.close()
        file = tmp_path / "journal" / FILE_NAME
        if damage == "short":
            file.write_bytes(file.read_bytes()[:-4000])
    words = ["replace", "--card", str(tmp_path), "--journal", str(tmp_path / "journal"), "--out", str(tmp_path / "new")]
    assert await asyncio.to_thread(main, words) == 2
    assert "--journal" in capsys.readouterr().err
    assert not (tmp_path / "new" / "MR1" / "journal").exists()


def test_the_image_takes_a_journal_over_once(tmp_path: Path) -> None:
    def run() -> str:
        words = [str(FILES / "take-over"), str(tmp_path / "boot" / "journal"), str(tmp_path / "lib" / "journal")]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout

    (tmp_path / "lib").mkdir()
    assert run() == ""
    (tmp_path / "boot" / "journal").mkdir(parents=True)
    (tmp_path / "boot" / "journal" / FILE_NAME).write_text("of the board before")
    # What a power cut left of an earlier attempt.
    (tmp_path / "lib" / "journal.new").mkdir()
    assert "is taken over" in run()
    taken = tmp_path / "lib" / "journal" / FILE_NAME
    assert taken.read_text() == "of the board before"
    taken.write_text("its own by now")
    assert run() == "" and taken.read_text() == "its own by now"

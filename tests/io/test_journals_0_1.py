"""Journals that version 0.1 wrote, one of each kind of machine: after them a machine says what it said before.

Each file was written by that version in a run of the shipped site of its name, and ends where something is in hand.
"""

import shutil
import zlib
from pathlib import Path

import pytest

from bus_sim.sites import find_site
from onboard.contract.cell_device import OrderAnswer
from onboard.contract.codes import Reason, TaskPhase
from onboard.contract.graph_device import VisitAnswer
from onboard.contract.messages import CarAt, Message, Reference, TaskReport, TokenGiven
from onboard.contract.terminal import PlanStep
from onboard.contract.turning_device import JobAnswer
from onboard.core.effects import Actuate, Send, Tell
from onboard.core.journal_records import Entry
from onboard.core.journal_state import JournalState
from onboard.core.records import next_boot
from onboard.core.site import journal_owner
from onboard.holon.holon import Holon
from onboard.io.journal import FileJournal
from onboard.systems.registry import condition_for, factory_for
from onboard.systems.terminal.desk import Desk

FOLDER = Path(__file__).parent / "journals_0_1"


def reports(node: int, *tasks: tuple[int, TaskPhase]) -> list[Message]:
    """Tasks of node 9."""
    return [TaskReport(node, Reference(9, number), phase, 0, Reason.NONE) for number, phase in tasks]


#: The words of one type that each says when it is started again.
SAID: dict[str, tuple[type[Message], object]] = {
    "small.MR1": (CarAt, [CarAt(11, Reference(1, 1), 65535, 2, 2980)]),
    "small.IOC1": (CarAt, [CarAt(1, Reference(1, 1), 389, 3, 2980)]),
    "small.ER1": (TokenGiven, 0),
    "cell.R1": (TaskReport, reports(1, (4, TaskPhase.AWARDED), (1, TaskPhase.DONE))),
    "cell.GM": (OrderAnswer, 4),
    "graph.R1": (TaskReport, reports(11, (6, TaskPhase.AWARDED), (1, TaskPhase.DONE))),
    "graph.OD": (VisitAnswer, 6),
    "terminal.R1": (PlanStep, 22),
    "turning.L3": (TaskReport, reports(3, (4, TaskPhase.AWARDED), (1, TaskPhase.DONE))),
    "turning.DESK": (JobAnswer, 4),
}


def started(name: str, folder: Path, journal: bytes | None = None) -> tuple[Holon, list[Message]]:
    """The machine that goes on with a journal, and what it says; its devices are still silent."""
    site_name, machine_name = name.split(".")
    site = find_site(site_name)
    machine = next(one for one in site.machines.values() if one.name == machine_name)
    if journal is None:
        shutil.copy(FOLDER / f"{name}.log", folder / "journal.log")
    else:
        (folder / "journal.log").write_bytes(journal)
    file = FileJournal(folder, journal_owner(site, machine))
    entries: list[Entry] = file.replay()
    condition = condition_for(site, file.condition, entries, file.name)
    factory = factory_for(site, machine.kind)
    holon = Holon(site, machine, factory, boot=next_boot(entries), entries=entries, journal=condition)
    effects = [*holon.start(0), *holon.behaviour.statements(0), *holon.behaviour.advance(0)]
    return holon, [one.message for one in effects if isinstance(one, Send | Actuate | Tell)]


@pytest.mark.parametrize("name", SAID)
def test_a_journal_of_version_0_1_is_gone_on_with(name: str, tmp_path: Path) -> None:
    holon, said = started(name, tmp_path)
    assert holon.journal.state is JournalState.INTACT, holon.journal.why
    kind, expected = SAID[name]
    words = [one for one in said if isinstance(one, kind)]
    assert (len(words) if isinstance(expected, int) else words) == expected
    assert holon.boot == 2


def test_a_terminals_desk_goes_on_with_its_tasks(tmp_path: Path) -> None:
    """Their rows are shorter in version 0.1; who has a task is heard of it no sooner than it is done."""
    holon, _ = started("terminal.Desk", tmp_path)
    assert isinstance(holon.behaviour, Desk) and holon.journal.state is JournalState.INTACT
    won = {Reference(1, number): winner for number, winner in ((3, 14), (4, 13), (5, 11), (6, 12), (7, 14))}
    assert holon.behaviour.orders.won == won


def test_a_record_that_has_not_its_form_makes_a_journal_short_and_is_named(tmp_path: Path) -> None:
    """It says no longer what is in hand; a person is told which record it is, and what to do."""
    lines = (FOLDER / "turning.L3.log").read_bytes().splitlines()
    number = next(index for index, line in enumerate(lines) if b'"job"' in line)
    body = lines[number].split(b" ", 1)[1].replace(b'"batch":', b'"batches":')
    lines[number] = b"%08x %s" % (zlib.crc32(body), body)
    holon, said = started("turning.L3", tmp_path, b"\n".join([*lines, b""]))
    assert holon.journal.state is JournalState.SHORT
    assert f"record {number + 1} (job): batch is missing" in holon.journal.line
    assert "onboard operate status tells what to do" in holon.journal.line
    assert holon.holding.is_held
    assert not [one for one in said if isinstance(one, TaskReport)]

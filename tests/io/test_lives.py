"""What is told of the last life, and what comes back by itself."""

from pathlib import Path

import pytest

from onboard.contract.codes import Reason
from onboard.io.endings import ExitStatus, ending_of
from onboard.io.lives import HEALTHY_US, LIMIT, LastLife, LifeBook


def test_a_first_life_and_one_that_ended_well_tell_nothing(tmp_path: Path) -> None:
    assert LifeBook(tmp_path / "journal").begin() == LastLife()
    lives = LifeBook(tmp_path / "journal")
    lives.begin()
    assert lives.end(ExitStatus.STOPPED, HEALTHY_US) is ExitStatus.STOPPED
    assert LifeBook(tmp_path / "journal").begin() == LastLife()


@pytest.mark.parametrize(
    ("result", "told", "reason"),
    [
        ("watchdog", "it hung, and its watchdog ended it", Reason.WATCHDOG),
        ("signal", "it was killed", Reason.NONE),
        ("", "the board was reset or lost its power", Reason.NONE),
    ],
)
def test_a_life_that_could_say_no_last_word_is_told(tmp_path: Path, result: str, told: str, reason: Reason) -> None:
    LifeBook(tmp_path / "journal").begin()
    if result:
        (tmp_path / "journal.ended").write_text(result + "\n")
    assert LifeBook(tmp_path / "journal").begin() == LastLife(f"the last life: {told}", reason)
    assert not (tmp_path / "journal.ended").exists(), "the next life has its own"


def test_an_own_fault_comes_back_but_not_for_ever(tmp_path: Path) -> None:
    def life(lived_us: int, *, own_fault: bool = True) -> ExitStatus:
        lives = LifeBook(tmp_path / "journal")
        lives.begin()
        return lives.end(ExitStatus.COMES_BACK, lived_us, own_fault=own_fault)

    assert [life(1) for _ in range(LIMIT)] == [*[ExitStatus.COMES_BACK] * (LIMIT - 1), ExitStatus.WAITS_FOR_PERSON]
    # A person has started it again; a long life is a new beginning.
    assert [life(1), life(1), life(HEALTHY_US), life(1), life(1)] == [ExitStatus.COMES_BACK] * 5
    # A full disk is no fault of its own.
    assert [life(1, own_fault=False) for _ in range(9)] == [ExitStatus.COMES_BACK] * 9


def test_files_that_cannot_be_read_or_written_stop_nobody(tmp_path: Path) -> None:
    (tmp_path / "journal.life").write_text("not json")
    assert LifeBook(tmp_path / "journal").begin() == LastLife()
    lives = LifeBook(tmp_path / "no folder" / "journal")
    assert lives.begin() == LastLife()
    assert lives.end(ExitStatus.STOPPED, 0) is ExitStatus.STOPPED


def test_files_that_are_not_ours_stop_nobody(tmp_path: Path) -> None:
    (tmp_path / "journal.life").write_text("[" * 1_000)
    (tmp_path / "journal.ended").symlink_to("/dev/zero")
    assert LifeBook(tmp_path / "journal").begin() == LastLife()
    (tmp_path / "other.life").symlink_to("/dev/zero")
    assert LifeBook(tmp_path / "other").begin() == LastLife()


def test_what_only_a_person_can_know_waits_for_one() -> None:
    by_itself = {reason for reason in Reason if ending_of(reason) is ExitStatus.COMES_BACK}
    assert ending_of(None) is ExitStatus.COMES_BACK, "a journal that cannot be written: its medium may have room again"
    assert by_itself == {Reason.INVARIANT_BROKEN, Reason.RUNAWAY, Reason.WATCHDOG, Reason.BUS_LOST}


def test_what_becomes_of_a_life_is_known_before_it_ends(tmp_path: Path) -> None:
    """The last word on the bus says whether a person is needed; what is asked changes nothing."""
    for _ in range(LIMIT - 1):
        lives = LifeBook(tmp_path / "journal")
        lives.begin()
        assert lives.foreseen(ExitStatus.COMES_BACK, 1, own_fault=True) is ExitStatus.COMES_BACK
        lives.end(ExitStatus.COMES_BACK, 1, own_fault=True)
    last = LifeBook(tmp_path / "journal")
    last.begin()
    assert last.foreseen(ExitStatus.COMES_BACK, 1) is ExitStatus.COMES_BACK, "a full disk"
    assert last.foreseen(ExitStatus.COMES_BACK, HEALTHY_US, own_fault=True) is ExitStatus.COMES_BACK
    for _ in range(2):
        assert last.foreseen(ExitStatus.COMES_BACK, 1, own_fault=True) is ExitStatus.WAITS_FOR_PERSON
    assert last.end(ExitStatus.COMES_BACK, 1, own_fault=True) is ExitStatus.WAITS_FOR_PERSON

"""The models themselves: what must hold holds in all states, and each planted bug is found."""

from pathlib import Path

from tests.models.spin import NEGOTIATION, TOKEN, verify


def test_never_two_holders_and_never_two_owners_in_a_million_states(tmp_path: Path) -> None:
    token = verify(tmp_path, TOKEN, "VERSIONS=6", "CRASHES=3")
    call = verify(tmp_path, NEGOTIATION, "MACHINES=3", "LOSSES=4")
    assert (token.errors, call.errors) == (0, 0), token.report + call.report
    assert token.states + call.states >= 1_000_000


def test_a_frame_before_the_journal_write_makes_two_holders(tmp_path: Path) -> None:
    found = verify(tmp_path, TOKEN, "SEND_FIRST")
    assert found.errors == 1
    assert "assertion violated" in found.report


def test_a_requested_token_moves_once_nothing_is_lost_any_more(tmp_path: Path) -> None:
    assert verify(tmp_path, TOKEN, "LIVE", "VERSIONS=2", is_liveness=True).errors == 0
    assert verify(tmp_path, TOKEN, "LIVE", "VERSIONS=2", "ONE_GRANT", is_liveness=True).errors == 1


def test_with_the_award_every_call_closes(tmp_path: Path) -> None:
    assert verify(tmp_path, NEGOTIATION, "MACHINES=2", is_liveness=True).errors == 0
    assert verify(tmp_path, NEGOTIATION, "MACHINES=2", "ONE_AWARD", is_liveness=True).errors == 1


def test_the_silent_award_makes_two_owners_with_one_single_omission(tmp_path: Path) -> None:
    assert verify(tmp_path, NEGOTIATION, "SILENT_AWARD", "MACHINES=3", "LOSSES=0").errors == 0
    found = verify(tmp_path, NEGOTIATION, "SILENT_AWARD", "MACHINES=2", "LOSSES=1")
    print(found.trail)
    assert found.errors == 1
    assert "assertion violated" in found.report
    assert found.trail.count("= 3") >= 1, "the trail shows the bid that was missed"

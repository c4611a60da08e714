"""The models themselves: what must hold holds in all states, and each planted bug is found."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.models.spin import NEGOTIATION, TOKEN, Verdict, verify
from tests.thinned import is_long


def test_never_two_holders_and_never_two_owners_in_all_states(tmp_path: Path) -> None:
    """A million of them where all is tried."""
    versions, losses, least = (6, 4, 1_000_000) if is_long() else (4, 2, 100_000)
    token = verify(tmp_path, TOKEN, f"VERSIONS={versions}", "CRASHES=3")
    call = verify(tmp_path, NEGOTIATION, "MACHINES=3", f"LOSSES={losses}")
    assert (token.errors, call.errors) == (0, 0), token.report + call.report
    assert token.states + call.states >= least


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


@cache
def verify_rules(*rules: str) -> Verdict:
    """The token with these rules, none left out."""
    with TemporaryDirectory() as folder:
        return verify(Path(folder), TOKEN, *rules)


@pytest.mark.parametrize(
    ("rules", "left_out"),
    [
        (("GHOST", "BELIEFS", "VERSIONS=4"), ("GULLIBLE",)),
        (("GHOST", "BELIEFS", "VERSIONS=4"), ("MEEK",)),
        (("OLD_COPY", f"VERSIONS={4 if is_long() else 3}"), ("NO_WITNESS",)),
        (("REGENERATE", "VERSIONS=4"), ("NO_FREEZE",)),
        (("REGENERATE", "VERSIONS=4"), ("NOT_ABOVE",)),
        (("REGENERATE", "VERSIONS=4"), ("ONE_ABOVE",)),
        (("REGENERATE", "VERSIONS=4"), ("NO_EPOCH",)),
        (("NODES=2", "VERSIONS=7", "CRASHES=0"), ("SERIAL",)),
        (("NODES=3", "VERSIONS=3", "CRASHES=1"), ("FIRST_OF_RUN",)),
    ],
    ids="-".join,
)
def test_each_rule_keeps_the_token_with_one_holder(
    rules: tuple[str, ...], left_out: tuple[str, ...], tmp_path: Path
) -> None:
    kept = verify_rules(*rules)
    assert kept.errors == 0, kept.trail
    found = verify(tmp_path, TOKEN, *rules, *left_out)
    assert found.errors == 1 and "assertion violated" in found.report


def test_who_missed_how_a_token_moved_gets_it_by_asking(tmp_path: Path) -> None:
    macros = ("LIVE", "BELIEFS", "MISSED", "VERSIONS=2", "LOSSES=1")
    assert verify(tmp_path, TOKEN, *macros, is_liveness=True).errors == 0
    assert verify(tmp_path, TOKEN, *macros, "NO_ANSWER", is_liveness=True).errors == 1

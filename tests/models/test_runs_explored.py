"""Runs of segments, explored in shipped code: one holder each, no trap; and each rule of runs is needed for it."""

from collections.abc import Sequence

import pytest

from onboard.contract.messages import TokenGrant, TokenHeld
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.belief import Belief
from onboard.core.effects import Effect, Send
from onboard.core.run_versions import RunVersions
from onboard.wire.runs import in_runs
from tests.models import runs
from tests.models.engine import Engine, Found, Limits
from tests.models.runs import PASSES, STANDS, STEWARD, RunPart

TWO, TRAP = "two hold a segment", "a trap"


def explored(nodes: tuple[int, ...], crashes: int, most_states: int = 20_000) -> Found:
    found = Engine(RunPart(versions=5, nodes=nodes), Limits(crashes, most_states)).run()
    print(found)
    return found


@pytest.mark.parametrize(
    ("nodes", "crashes"), [((STEWARD, PASSES, STANDS), 0), ((STEWARD, PASSES), 1)], ids=["three", "a-crash"]
)
def test_never_two_holders_and_never_a_trap(nodes: tuple[int, ...], crashes: int) -> None:
    found = explored(nodes, crashes)
    assert not found.why
    assert found.transitions > 25_000


def _first_and_one(versions: RunVersions, key: TokenKey, own: int, to: int, now_us: int) -> int:
    """The version after that of the first of the run, for all of it."""
    at_us, node, number, given = versions._last
    version = given if (at_us, node) == (now_us, to) and abs(number - key.number) == 1 else own + 1
    versions._last = now_us, to, key.number, version
    return version


def test_a_run_under_the_version_after_its_firsts_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Or nobody takes what is not newer: then it is lost."""
    monkeypatch.setattr(RunVersions, "following", _first_and_one)
    assert explored((STEWARD, PASSES, STANDS), 0, 200_000).why in (TWO, TRAP)


def test_a_run_that_is_said_before_it_is_written_makes_two_holders(monkeypatch: pytest.MonkeyPatch) -> None:
    def hasty(effects: Sequence[Effect]) -> list[Effect]:
        return sorted(in_runs(effects), key=lambda effect: not isinstance(effect, Send))

    monkeypatch.setattr(runs, "in_runs", hasty)
    assert explored((STEWARD, PASSES), 1).why == TWO


def test_a_run_that_is_taken_for_its_first_segment_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether a version is newer is asked of each segment: what was given on since would come back."""
    on_grant = TokenBook.on_grant

    def whole(book: TokenBook, grant: TokenGrant, now_us: int) -> list[Effect]:
        key = TokenKey(grant.token_kind, grant.token)
        if grant.holder == book.node_id and key == runs.FAR and runs.NEAR in book.held and not book.holds(key):
            book.seen.pop(key, None)
            book.beliefs.verified[key] = Belief(0, grant.sender)
        return on_grant(book, grant, now_us)

    monkeypatch.setattr(TokenBook, "on_grant", whole)
    assert explored((STEWARD, PASSES, STANDS), 0, 200_000).why in (TWO, TRAP)


def test_one_segment_that_is_held_does_not_confirm_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    on_held = TokenBook.on_held

    def hasty(book: TokenBook, statement: TokenHeld, now_us: int = 0) -> list[Effect]:
        effects = on_held(book, statement, now_us)
        if runs.NEAR not in book.leaving or runs.FAR not in book.leaving:
            book.leaving.clear()
        return effects

    monkeypatch.setattr(TokenBook, "on_held", hasty)
    assert explored((STEWARD, PASSES, STANDS), 0, 200_000).why == TRAP


def test_a_run_that_is_granted_once_is_a_trap(monkeypatch: pytest.MonkeyPatch) -> None:
    wake = TokenBook.wake

    def asks_only(book: TokenBook, now_us: int) -> list[Effect]:
        effects = wake(book, now_us)
        return [one for one in effects if not (isinstance(one, Send) and isinstance(one.message, TokenGrant))]

    monkeypatch.setattr(TokenBook, "wake", asks_only)
    assert explored((STEWARD, PASSES), 0).why == TRAP

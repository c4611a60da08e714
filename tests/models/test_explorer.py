"""Every interleaving of the shipped token book: one holder at most, no trap; and each rule is needed for it."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from onboard.core.authority import TokenBook
from onboard.core.belief import Belief, Beliefs
from onboard.core.effects import Effect
from onboard.holon.witness import Witness
from tests.models.explorer import Explorer, Found, Limits

#: Limits of CPU time are for runs in which a bug is looked for; a clean run has to be complete.
_HUNT_S = 10.0


def explore(nodes: int, versions: int, crashes: int = 0, **more: Any) -> Found:
    return Explorer(Limits(nodes, versions, crashes, **more)).run()


@pytest.mark.parametrize(
    ("limits", "at_least"),
    [
        (Limits(nodes=3, versions=2, crashes=0), 300_000),
        (Limits(nodes=2, versions=3, crashes=2), 1_000_000),
        (Limits(nodes=2, versions=3, crashes=1, old_copies=1), 400_000),
        (Limits(nodes=2, versions=2, crashes=1, has_ghost=True), 1_500_000),
    ],
    ids=["three-nodes", "crashes", "an-old-copy", "a-ghost"],
)
def test_never_two_holders_and_never_a_trap(limits: Limits, at_least: int) -> None:
    """Three million transitions and more together: ``at_least`` so many of each."""
    found = Explorer(limits).run()
    print(found)
    assert (found.two, found.trap, found.alarm) == (None, None, None)
    assert found.is_complete and found.transitions >= at_least


@pytest.mark.parametrize(
    "limits",
    [
        Limits(nodes=3, versions=1, crashes=0),
        Limits(nodes=2, versions=2, crashes=1),
        Limits(nodes=2, versions=1, crashes=1, has_ghost=True),
    ],
    ids=["three-nodes", "a-crash", "a-ghost"],
)
def test_packed_as_many_are_seen_as_one_by_one(limits: Limits) -> None:
    explorer = Explorer(limits)
    seen, waiting, transitions = {explorer.begin()}, [explorer.begin()], 0
    while waiting:
        state = waiting.pop()
        found = [after for after, _ in explorer.alone(state)]
        found += [after for i in range(limits.nodes) for after in explorer.moves(state, i)]
        transitions += len(found)
        waiting += [after for after in set(found) if after not in seen]
        seen.update(found)
    packed = Explorer(limits).run()
    assert (packed.states, packed.transitions) == (len(seen), transitions)
    assert packed.is_complete and packed.states > 200


def _reversed(method: Callable[..., list[Effect]]) -> Callable[..., list[Effect]]:
    return lambda *args: method(*args)[::-1]


def test_a_frame_before_its_journal_write_makes_two_holders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TokenBook, "give", _reversed(TokenBook.give))
    assert explore(2, 2, 1, most_s=_HUNT_S).two is not None


def test_a_right_that_is_used_before_all_have_answered_makes_two_holders(monkeypatch: pytest.MonkeyPatch) -> None:
    """An old copy of a journal: only the others know what was given away since."""
    monkeypatch.setattr(Witness, "hear", lambda *_: None)
    assert explore(2, 2, 1, old_copies=1, most_s=_HUNT_S).two is not None


def test_a_grant_that_counts_from_anybody_makes_two_holders(monkeypatch: pytest.MonkeyPatch) -> None:
    of = Beliefs.of

    def gullible(beliefs: Beliefs, key: Any) -> Belief:
        return of(beliefs, key)._replace(holder=_Anybody())

    monkeypatch.setattr(Beliefs, "of", gullible)
    assert explore(2, 2, 0, has_ghost=True, most_s=_HUNT_S).two is not None


class _Anybody(int):
    """A node that is whoever it is compared with."""

    def __eq__(self, other: object) -> bool:
        return True

    def __ne__(self, other: object) -> bool:
        return False

    __hash__ = int.__hash__


def test_a_right_that_leaves_by_a_strangers_claim_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    def meek(book: TokenBook, key: Any, by: int, now_us: int) -> list[Effect]:
        book.held.pop(key, None)
        book.seen[key] = book.seen.get(key, 0)
        return []

    monkeypatch.setattr(TokenBook, "_claimed", meek)
    assert explore(2, 2, 0, has_ghost=True, most_s=_HUNT_S).trap is not None


def test_a_dispute_without_an_answer_is_a_trap(monkeypatch: pytest.MonkeyPatch) -> None:
    """One lost frame: a bystander that missed a grant refuses the next one for ever."""
    monkeypatch.setattr(TokenBook, "on_dispute", lambda *_: [])
    assert explore(3, 2, 0, most_s=_HUNT_S).trap is not None


def test_a_grant_that_is_said_once_is_a_trap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TokenBook, "wake", lambda *_: [])
    assert explore(2, 2, 0, most_s=_HUNT_S).trap is not None


def test_a_forgotten_take_that_nobody_misses_is_a_trap(monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(*_: object) -> Iterable[Effect]:
        return []

    monkeypatch.setattr(Witness, "_tell_doubted", silent)
    assert explore(2, 2, 1, old_copies=1, most_s=_HUNT_S).trap is not None

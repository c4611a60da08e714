"""Tokens: one holder each, whatever the bus loses, repeats or delays."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.constants import MAX_VERSION
from onboard.contract.messages import (
    Message,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    TokenSeen,
)
from onboard.core.authority import TokenBook, TokenKey, segment_token
from onboard.core.effects import Effect, Record, Report
from onboard.core.motion_authority import MotionAuthority, authorised
from onboard.core.site import Segment
from onboard.ways.tokens import car_token
from tests.core.token_words import hear, said
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ALICE, BOB = 1, 11, 12
SEGMENT = Segment(1, 7)
KEY = segment_token(SEGMENT)


def test_the_site_file_names_the_first_holders() -> None:
    home = SITE.machines[ALICE].home
    books = {node: TokenBook(SITE, node) for node in (STEWARD, ALICE, BOB)}
    assert [node for node, book in books.items() if book.holds(KEY)] == [STEWARD]
    assert [node for node, book in books.items() if book.holds(segment_token(home))] == [ALICE]
    bay = TokenKey(TokenKind.STATION, SITE.compartments[STEWARD].number)
    assert [node for node, book in books.items() if book.holds(bay)] == [STEWARD]


def test_a_grant_is_erased_and_journalled_before_it_is_sent() -> None:
    steward = TokenBook(SITE, STEWARD)
    effects = steward.give(KEY, ALICE, 0)
    assert not steward.holds(KEY)
    assert isinstance(effects[0], Record) and effects[0].entry["record"] == "token_given"
    assert said(effects[1:]) == [TokenGrant(STEWARD, TokenKind.SEGMENT, KEY.number, 1, ALICE)]


def test_giving_what_is_not_held_is_a_broken_invariant() -> None:
    with pytest.raises(ValueError, match="does not hold"):
        TokenBook(SITE, ALICE).give(KEY, BOB, 0)


def test_a_request_is_granted_once_and_a_lost_grant_is_said_again() -> None:
    steward, alice = TokenBook(SITE, STEWARD), TokenBook(SITE, ALICE)
    (request,) = said(alice.want(KEY, 0))
    assert isinstance(request, TokenRequest)
    first = said(steward.on_request(request, Reason.NONE, 0))
    again = said(steward.wake(SITE.timing.token_repeat_us))
    assert again == first
    assert said(steward.on_request(request, Reason.NONE, SITE.timing.token_repeat_us + 10)) == []
    assert said(steward.on_request(request, Reason.NONE, SITE.timing.token_repeat_us * 3 // 2)) == first
    (grant,) = first
    assert isinstance(grant, TokenGrant)
    (held,) = said(alice.on_grant(grant, 20))
    assert alice.holds(KEY) and isinstance(held, TokenHeld)
    steward.on_held(held)
    assert steward.next_wake() is None
    assert said(alice.on_grant(grant, 30)) == [held], "a repeated grant shows that the statement was lost"


def test_a_refusal_tells_the_requester_why() -> None:
    steward, alice = TokenBook(SITE, STEWARD), TokenBook(SITE, ALICE)
    (request,) = said(alice.want(KEY, 0))
    assert isinstance(request, TokenRequest)
    (refusal,) = said(steward.on_request(request, Reason.TOKEN_NOT_GRANTABLE_YET, 0))
    assert isinstance(refusal, TokenRefusal)
    alice.on_refusal(refusal, 0)
    assert authorised(MotionAuthority(alice), [KEY]).reason is Reason.TOKEN_NOT_GRANTABLE_YET


def test_a_stale_duplicate_of_a_grant_never_doubles_a_token() -> None:
    steward, alice = TokenBook(SITE, STEWARD), TokenBook(SITE, ALICE)
    (grant,) = said(steward.give(KEY, ALICE, 0))
    assert isinstance(grant, TokenGrant)
    alice.on_grant(grant, 0)
    (back,) = said(alice.give(KEY, STEWARD, 1))
    assert isinstance(back, TokenGrant)
    steward.on_grant(back, 2)
    alice.on_grant(grant, 3)
    assert steward.holds(KEY) and not alice.holds(KEY)


def test_a_grant_for_somebody_else_is_never_taken() -> None:
    alice = TokenBook(SITE, ALICE)
    alice.on_grant(TokenGrant(STEWARD, KEY.kind, KEY.number, 1, BOB), 0)
    assert not alice.holds(KEY) and alice.holder_of(KEY) == BOB


def test_the_journal_restores_holdings_and_open_grants() -> None:
    steward, alice = TokenBook(SITE, STEWARD), TokenBook(SITE, ALICE)
    given = steward.give(KEY, ALICE, 0)
    entries = [effect.entry for effect in given if isinstance(effect, Record)]
    restarted = TokenBook(SITE, STEWARD)
    restarted.replay(entries)
    assert not restarted.holds(KEY)
    (repeat,) = said(restarted.wake(0))
    assert isinstance(repeat, TokenGrant)
    taken = alice.on_grant(repeat, 0)
    awake = TokenBook(SITE, ALICE)
    awake.replay([effect.entry for effect in taken if isinstance(effect, Record)])
    assert awake.holds(KEY)


@given(st.integers(0, 2**32 - 1))
def test_one_holder_at_most_whatever_is_lost_repeated_or_late(seed: int) -> None:
    """Three nodes hand one token around over a bus that loses, doubles and delays frames at single receivers.

    At every moment at most one of them holds it, and once the bus is well again somebody does.
    """
    chance = random.Random(seed)
    books = {node: TokenBook(SITE, node) for node in (STEWARD, ALICE, BOB)}
    wire: list[tuple[int, Message]] = []
    now_us = 0

    def post(effects: list[Effect], lossy: bool) -> None:
        for message in said(effects):
            for node in books:
                if node == message.sender:
                    continue
                copies = chance.choice((0, 1, 1, 1, 2)) if lossy else 1
                wire.extend((node, message) for _ in range(copies))

    def deliver(lossy: bool) -> None:
        node, message = wire.pop(chance.randrange(len(wire)) if lossy else 0)
        book = books[node]
        post(hear(book, message, now_us), lossy)

    for step in range(120):
        lossy = step < 90
        if step % 4 == 0 and lossy:
            post(books[chance.choice((ALICE, BOB, STEWARD))].want(KEY, now_us), lossy)
        for _ in range(chance.randrange(4)):
            if wire:
                deliver(lossy)
            assert sum(book.holds(KEY) for book in books.values()) <= 1
        now_us += SITE.timing.token_repeat_us
        for book in books.values():
            post(book.wake(now_us), lossy)
        while wire and not lossy:
            deliver(lossy)
            assert sum(book.holds(KEY) for book in books.values()) <= 1
    for book in books.values():
        book.forget(KEY)
    assert sum(book.holds(KEY) for book in books.values()) == 1


def test_a_new_car_has_one_custodian() -> None:
    key = car_token(STEWARD, 5)
    steward = TokenBook(SITE, STEWARD)
    steward.create(key)
    assert steward.holds(key)
    with pytest.raises(ValueError, match="exists already"):
        steward.create(key)


# --- what ends a grant, and from whom one counts (docs/protocol.md) --------------------------------------------


def entries(effects: list[Effect]) -> list[dict[str, str | int]]:
    return [dict(effect.entry) for effect in effects if isinstance(effect, Record)]


def grant(giver: int, version: int, holder: int) -> TokenGrant:
    return TokenGrant(giver, KEY.kind, KEY.number, version, holder)


def replayed(node: int, journal: list[dict[str, str | int]]) -> TokenBook:
    book = TokenBook(SITE, node)
    book.replay(journal)
    return book


@pytest.mark.parametrize(
    "proof",
    [
        TokenHeld(ALICE, KEY.kind, KEY.number, 1),
        TokenHeld(ALICE, KEY.kind, KEY.number, 3),
        grant(ALICE, 2, BOB),
        TokenGiven(ALICE, KEY.kind, KEY.number, 2, BOB),
    ],
)
def test_whatever_proves_that_a_grant_came_is_journalled_and_no_restart_revives_it(proof: Message) -> None:
    steward = TokenBook(SITE, STEWARD)
    journal = entries(steward.give(KEY, ALICE, 0))
    journal += entries(hear(steward, proof, 10))
    assert steward.next_wake() is None
    assert said(replayed(STEWARD, journal).wake(1 << 40)) == []


def test_a_word_of_nobody_who_was_given_it_does_not_end_a_grant() -> None:
    steward = TokenBook(SITE, STEWARD)
    steward.give(KEY, ALICE, 0)
    for word in (TokenHeld(BOB, KEY.kind, KEY.number, 2), grant(BOB, 2, BOB), TokenHeld(240, KEY.kind, KEY.number, 9)):
        hear(steward, word, 10)
    assert said(steward.wake(1 << 40)) == [grant(STEWARD, 1, ALICE)]


def test_a_version_beyond_half_its_range_is_newer_still_and_the_last_one_is_not_passed() -> None:
    alice = TokenBook(SITE, ALICE)
    alice.seen[KEY] = 1
    hear(alice, grant(STEWARD, MAX_VERSION, ALICE), 0)
    assert alice.holds(KEY)
    with pytest.raises(ValueError, match="no version left"):
        alice.give(KEY, BOB, 0)
    assert alice.holds(KEY)


def test_a_grant_of_a_node_that_does_not_hold_the_token_is_disputed_and_not_taken() -> None:
    alice, steward = TokenBook(SITE, ALICE), TokenBook(SITE, STEWARD)
    for giver in (240, BOB):
        assert said(hear(alice, grant(giver, 5, ALICE), 1 << 30)) in (
            [TokenDispute(ALICE, KEY.kind, KEY.number, 5, STEWARD)],
            [],
        )
    assert not alice.holds(KEY)
    assert alice.drops[Reason.NOT_THE_HOLDER] == 2
    (answer,) = said(hear(steward, TokenDispute(ALICE, KEY.kind, KEY.number, 5, STEWARD), 0))
    assert answer == TokenHeld(STEWARD, KEY.kind, KEY.number, 0)
    hear(alice, answer, 1 << 30)
    assert not alice.holds(KEY)
    hear(alice, grant(STEWARD, 1, ALICE), 1 << 30)
    assert alice.holds(KEY)


def test_a_grant_that_came_by_a_giver_that_was_not_heard_is_taken_once_its_giver_says_so() -> None:
    """The steward gave it to Bob while Alice was deaf; Bob gives it to her."""
    steward, alice, bob = (TokenBook(SITE, node) for node in (STEWARD, ALICE, BOB))
    steward.give(KEY, BOB, 0)
    hear(bob, grant(STEWARD, 1, BOB), 1)
    (given,) = said(bob.give(KEY, ALICE, 2))
    (dispute,) = said(hear(alice, given, 3))
    assert dispute == TokenDispute(ALICE, KEY.kind, KEY.number, 2, STEWARD)
    (answer,) = said(hear(steward, dispute, 4))
    assert answer == TokenGiven(STEWARD, KEY.kind, KEY.number, 1, BOB)
    assert said(hear(alice, answer, 5)) == [TokenHeld(ALICE, KEY.kind, KEY.number, 2)]
    assert alice.holds(KEY)


def test_the_answer_to_a_dispute_outlives_a_restart() -> None:
    steward = TokenBook(SITE, STEWARD)
    journal = entries(steward.give(KEY, BOB, 0)) + entries(hear(steward, TokenHeld(BOB, KEY.kind, KEY.number, 1), 1))
    dispute = TokenDispute(ALICE, KEY.kind, KEY.number, 2, STEWARD)
    assert said(hear(replayed(STEWARD, journal), dispute, 4)) == [TokenGiven(STEWARD, KEY.kind, KEY.number, 1, BOB)]


def test_many_who_dispute_are_answered_once() -> None:
    steward = TokenBook(SITE, STEWARD)
    steward.give(KEY, BOB, 0)
    disputes = [TokenDispute(node, KEY.kind, KEY.number, 2, STEWARD) for node in (ALICE, BOB, 13)]
    assert sum(len(said(hear(steward, dispute, 5))) for dispute in disputes) == 1


def test_an_unverified_grant_that_was_overheard_does_not_make_the_true_one_old() -> None:
    alice = TokenBook(SITE, ALICE)
    hear(alice, grant(240, 900, 240), 0)
    hear(alice, grant(BOB, 900, BOB), 0)
    hear(alice, TokenHeld(BOB, KEY.kind, KEY.number, 900), 0)
    hear(alice, grant(STEWARD, 1, ALICE), 1)
    assert alice.holds(KEY)


@pytest.mark.parametrize(
    "word",
    [
        TokenHeld(BOB, KEY.kind, KEY.number, 900),
        TokenHeld(BOB, KEY.kind, KEY.number, 1),
        grant(BOB, 900, BOB),
        grant(BOB, 900, ALICE),
        TokenGiven(BOB, KEY.kind, KEY.number, 900, 13),
    ],
)
def test_a_right_leaves_by_its_holders_own_hand_only_and_who_claims_it_is_named(word: Message) -> None:
    alice = TokenBook(SITE, ALICE)
    hear(alice, grant(STEWARD, 1, ALICE), 0)
    effects = hear(alice, word, 1 << 30)
    assert alice.holds(KEY) and alice.held[KEY] == 1
    assert alice.drops[Reason.RIGHT_CLAIMED] == 1
    assert said(effects) == [TokenHeld(ALICE, KEY.kind, KEY.number, 1)]
    assert [effect.text for effect in effects if isinstance(effect, Report)] == [
        "node 12 claims SEGMENT 263, which is mine"
    ]


def test_who_says_that_it_holds_what_it_gave_away_is_told_what_came_after() -> None:
    alice = TokenBook(SITE, ALICE)
    hear(alice, grant(STEWARD, 1, ALICE), 0)
    (word,) = said(hear(alice, TokenHeld(BOB, KEY.kind, KEY.number, 0), 1 << 30))
    assert word == TokenSeen(ALICE, KEY.kind, KEY.number, 1, ALICE)

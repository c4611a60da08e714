"""Tokens: one holder each, whatever the bus loses, repeats or delays."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.core.authority import MotionState, TokenBook, TokenKey, authorised, car_token, segment_token
from onboard.core.codes import Reason, TokenKind
from onboard.core.effects import Effect, Record, Send
from onboard.core.messages import Message, TokenGrant, TokenHeld, TokenRefusal, TokenRequest
from onboard.core.site import Segment
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ALICE, BOB = 1, 11, 12
SEGMENT = Segment(1, 7)
KEY = segment_token(SEGMENT)


def said(effects: list[Effect]) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Send)]


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
    state = MotionState(alice, position_known=True, stopped=False)
    assert authorised(state, SEGMENT) == (False, Reason.TOKEN_NOT_GRANTABLE_YET)


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


@pytest.mark.parametrize(
    ("known", "stopped", "reason"),
    [(False, False, Reason.POSITION_UNKNOWN), (True, True, Reason.OPERATOR), (True, False, Reason.NOT_AUTHORISED)],
)
def test_nothing_but_authorised_permits_motion(known: bool, stopped: bool, reason: Reason) -> None:
    assert authorised(MotionState(TokenBook(SITE, ALICE), known, stopped), SEGMENT) == (False, reason)


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
        if isinstance(message, TokenRequest):
            post(book.on_request(message, Reason.NONE, now_us), lossy)
        elif isinstance(message, TokenGrant):
            post(book.on_grant(message, now_us), lossy)
        elif isinstance(message, TokenHeld):
            post(book.on_held(message), lossy)

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

"""Open requests: remembered by the holder, oldest first, all tokens or none where no order is agreed."""

import pytest

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.messages import TokenGrant, TokenRefusal, TokenRequest
from onboard.core.authority import REFUSED_REPEATS, Claim, TokenBook, TokenKey, segment_token
from onboard.core.backoff import LONGEST_REPEATS
from onboard.core.effects import Effect, Send
from onboard.core.petitions import UNORDERED, Petitions
from onboard.core.site import Segment
from onboard.ways.all_or_none import PATIENCE_REPEATS, AllOrNone
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ALICE, BOB = 1, 11, 12
KEYS = [segment_token(Segment(1, index)) for index in (5, 6, 7)]
SLOTS = tuple(Segment(1, index) for index in (5, 6, 7))
REPEAT_US = SITE.timing.token_repeat_us


def request(node: int, key: TokenKey, version: int = UNORDERED) -> TokenRequest:
    return TokenRequest(node, key.kind, key.number, 0, version, 0)


def requested(effects: list[Effect]) -> list[int]:
    return [e.message.token & 0xFF for e in effects if isinstance(e, Send) and isinstance(e.message, TokenRequest)]


def granted(effects: list[Effect]) -> list[int]:
    return [e.message.token & 0xFF for e in effects if isinstance(e, Send) and isinstance(e.message, TokenGrant)]


def test_whoever_was_refused_asks_less_often() -> None:
    alice = TokenBook(SITE, ALICE)
    alice.want(KEYS[0], 0)
    alice.on_refusal(TokenRefusal(STEWARD, *KEYS[0], 0, ALICE, Reason.TOKEN_NOT_GRANTABLE_YET), 0)
    assert alice.wake(REFUSED_REPEATS * REPEAT_US - 1) == []
    assert requested(alice.wake(REFUSED_REPEATS * REPEAT_US)) == [5]


@pytest.mark.parametrize(
    ("why", "repeats"),
    [
        (Reason.TOKEN_NOT_GRANTABLE_YET, LONGEST_REPEATS),
        (Reason.DOOR_NOT_READY, LONGEST_REPEATS),
        (Reason.MIRROR_BEHIND, REFUSED_REPEATS),
    ],
)
def test_whose_plan_needs_a_slot_asks_seldom_where_time_alone_ends_the_refusal(why: Reason, repeats: int) -> None:
    """Long before the petition lapses all the same."""
    alice = TokenBook(SITE, ALICE, claim=lambda key: Claim(9, BOB))
    alice.want(KEYS[0], 0)
    alice.on_refusal(TokenRefusal(STEWARD, *KEYS[0], 0, ALICE, why), 0)
    assert alice.wake(repeats * REPEAT_US - 1) == []
    assert requested(alice.wake(repeats * REPEAT_US)) == [5]


def test_a_request_says_the_plan_that_needs_it_and_who_comes_first() -> None:
    alice = TokenBook(SITE, ALICE, claim=lambda key: Claim(9, BOB))
    (said,) = (e.message for e in alice.want(KEYS[0], 0) if isinstance(e, Send))
    assert isinstance(said, TokenRequest) and (said.itinerary_version, said.predecessor) == (9, BOB)
    alice.unordered = {KEYS[1]}
    (said,) = (e.message for e in alice.want(KEYS[1], 0) if isinstance(e, Send))
    assert isinstance(said, TokenRequest) and (said.itinerary_version, said.predecessor) == (0, 0)


def test_open_requests_are_looked_at_again_oldest_first_and_at_once_when_the_token_comes() -> None:
    petitions = Petitions(REPEAT_US)
    petitions.hear(KEYS[0], request(BOB, KEYS[0], 3), 10)
    petitions.hear(KEYS[0], request(ALICE, KEYS[0], 3), 20)
    assert petitions.due(KEYS[0], 30) == []
    petitions.returned(KEYS[0], 40)
    assert petitions.due(KEYS[0], 40) == [BOB, ALICE]
    assert petitions.due(KEYS[0], 50) == []
    assert petitions.due(KEYS[0], 40 + REPEAT_US) == [BOB, ALICE]


def test_a_request_that_is_not_repeated_lapses() -> None:
    petitions = Petitions(REPEAT_US)
    petitions.hear(KEYS[0], request(BOB, KEYS[0], 3), 0)
    assert petitions.due(KEYS[0], 62 * REPEAT_US) == [BOB], "two of the longest repeats may be lost"
    assert petitions.due(KEYS[0], 63 * REPEAT_US) == []
    petitions.hear(KEYS[0], request(BOB, KEYS[0], 0), 0)
    assert petitions.due(KEYS[0], 26 * REPEAT_US) == [], "without an order it would stand before others"
    assert petitions.open == {}
    for number in range(1000):
        petitions.hear(TokenKey(TokenKind.CAR, number), request(BOB, KEYS[0], 3), number * REPEAT_US)
    assert len(petitions.open) < 70, "also of tokens that are never held here"


def test_all_holders_serve_the_machine_that_has_asked_longest() -> None:
    """Bob asked first for another token of his set: that is his age for all of them."""
    petitions = Petitions(REPEAT_US)
    petitions.hear(KEYS[1], request(BOB, KEYS[1]), 0)
    petitions.hear(KEYS[0], request(ALICE, KEYS[0]), 10)
    petitions.hear(KEYS[0], request(BOB, KEYS[0]), 20)
    assert petitions.is_oldest_unordered(KEYS[0], BOB, 30)
    assert not petitions.is_oldest_unordered(KEYS[0], ALICE, 30)


def test_an_incomplete_set_is_given_back_but_for_what_the_body_is_in() -> None:
    alice = TokenBook(SITE, ALICE)
    whole = AllOrNone(alice)
    whole.begin(SLOTS, 0)
    assert requested(whole.advance(SLOTS[:1], 0)) == [5, 6, 7]
    for key in KEYS[:2]:
        alice.on_grant(TokenGrant(STEWARD, *key, 1, ALICE), 5)
    assert not whole.is_complete
    assert granted(whole.advance(SLOTS[:1], PATIENCE_REPEATS * REPEAT_US)) == [6]
    assert alice.holds(KEYS[0])
    again = whole.advance(SLOTS[:1], (PATIENCE_REPEATS + 1) * REPEAT_US)
    assert 6 in requested(again), "after a rest it asks anew"


def test_a_complete_set_is_kept_until_its_refuge() -> None:
    alice = TokenBook(SITE, ALICE)
    whole = AllOrNone(alice)
    whole.begin(SLOTS, 0)
    for key in KEYS:
        alice.on_grant(TokenGrant(STEWARD, *key, 1, ALICE), 5)
    assert whole.is_complete
    assert whole.advance(SLOTS[:1], PATIENCE_REPEATS * REPEAT_US) == []
    whole.passed({SLOTS[1]})
    assert whole.slots == SLOTS[1:]
    whole.passed({SLOTS[2]})
    assert whole.slots == () and alice.unordered == set()

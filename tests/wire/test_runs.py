"""Words about segments in line go as one frame and come back as they were, whatever a frame says."""

import random
from collections.abc import Sequence

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import Reason, TokenKind
from onboard.contract.messages import (
    BusTime,
    Message,
    TokenDispute,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
)
from onboard.contract.runs import MOST_OF_RUN, MOST_SPREAD, singles
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.records import TokenGivenRecord
from onboard.holon.admission import Admission
from onboard.wire.codec import fleet_codec
from onboard.wire.runs import in_runs

SEGMENT, RUN = TokenKind.SEGMENT, TokenKind.RUN


def grant(index: int, version: int = 7, to: int = 12, track: int = 3, sender: int = 5) -> TokenGrant:
    return TokenGrant(sender, SEGMENT, track << 8 | index, version, to)


def written(index: int) -> Record:
    return Record(TokenGivenRecord(SEGMENT, 3 << 8 | index, 7, 12))


def said(effects: Sequence[Effect]) -> list[Message]:
    return [one.message for one in effects if isinstance(one, Send)]


def heard(words: list[Message]) -> list[Message]:
    """What another machine takes up of words, through the codec."""
    found: list[Message] = []
    for word in words:
        (frame,) = fleet_codec().encode(word)
        message = fleet_codec().decode_part(frame)
        assert isinstance(message, Message)
        found += singles(message)
    return found


@pytest.mark.parametrize("indices", [[4, 5, 6], [6, 5, 4], [0, 1], [254, 255]])
def test_a_run_is_one_frame_behind_all_its_records(indices: list[int]) -> None:
    given: list[Effect] = [effect for one in indices for effect in (written(one), Send(grant(one)))]
    effects = in_runs(given)
    assert effects[:-1] == [written(one) for one in indices]
    assert said(effects) == [TokenGrant(5, RUN, 3 << 16 | indices[0] << 8 | indices[-1], 7, 12)]
    assert heard(said(effects)) == [grant(one) for one in indices]


@pytest.mark.parametrize(
    "words",
    [
        [grant(4), grant(6)],
        [grant(4), grant(5, version=8)],
        [grant(4), grant(5, to=11)],
        [grant(255), grant(0, track=4)],
        [grant(4), TokenHeld(5, SEGMENT, 3 << 8 | 5, 7)],
        [grant(4), TokenGrant(5, TokenKind.STATION, 3 << 8 | 5, 7, 12)],
        [TokenDispute(5, SEGMENT, 3 << 8 | 4, 7, 12), TokenDispute(5, SEGMENT, 3 << 8 | 5, 7, 12)],
        [TokenRequest(5, SEGMENT, 3 << 8 | 4, 0, 9, 1), TokenRequest(5, SEGMENT, 3 << 8 | 5, 0, 9, 2)],
        [TokenRequest(5, SEGMENT, 3 << 8 | 4, 0, 9, 1), TokenRequest(5, SEGMENT, 3 << 8 | 5, MOST_SPREAD, 9, 1)],
    ],
    ids=["a-gap", "versions", "receivers", "tracks", "words", "kinds", "seldom-words", "predecessors", "far-apart"],
)
def test_what_does_not_say_the_same_stays_as_it_is(words: list[Message]) -> None:
    assert said(in_runs([Send(word) for word in words])) == words


def test_nothing_else_is_overtaken() -> None:
    """A word that follows something said, done or told otherwise still does."""
    between: list[Effect] = [Send(BusTime(5, 1)), Report("there")]
    for one in between:
        effects: list[Effect] = [Send(grant(4)), one, Send(grant(5))]
        assert in_runs(effects) == effects


def test_a_request_tells_the_least_of_its_versions_and_a_refusal_too() -> None:
    newest = (1 << 20) - 1
    for seen, least in (([3, 1, 2], 1), ([newest, 0, 1], newest)):
        asked = [TokenRequest(11, SEGMENT, 3 << 8 | 4 + at, one, 9, 1) for at, one in enumerate(seen)]
        (request,) = said(in_runs([Send(one) for one in asked]))
        assert isinstance(request, TokenRequest) and request.version_seen == least
        refused = [
            TokenRefusal(5, SEGMENT, 3 << 8 | 4 + at, one, 11, Reason.MIRROR_BEHIND) for at, one in enumerate(seen)
        ]
        (refusal,) = said(in_runs([Send(one) for one in refused]))
        assert isinstance(refusal, TokenRefusal) and refusal.version == least


def test_a_long_way_goes_in_runs_of_the_most_that_is_written_at_once() -> None:
    words = said(in_runs([Send(grant(one)) for one in range(2 * MOST_OF_RUN + 1)]))
    assert [len(singles(word)) for word in words] == [MOST_OF_RUN, MOST_OF_RUN, 1]


def test_whatever_is_joined_is_taken_apart_as_it_was() -> None:
    draw = random.Random(1)
    for _ in range(300):
        words: list[Message] = [
            grant(draw.randrange(6), draw.choice([7, 7, 7, 8]), draw.choice([11, 12, 12])) for _ in range(8)
        ]
        assert heard(said(in_runs([Send(one) for one in words]))) == words


def test_a_run_that_is_too_long_is_nothing() -> None:
    for first, last in ((0, MOST_OF_RUN), (255, 0)):
        word = TokenGrant(5, RUN, 3 << 16 | first << 8 | last, 7, 12)
        assert list(singles(word)) == []
        assert Admission(find_site("small")).why_not(word) is Reason.VALUE_OUT_OF_RANGE
    assert list(singles(TokenGrant(5, RUN, 3 << 16 | 4 << 8 | 4, 7, 12))) == [grant(4)]

"""Tokens: chapter 8 of docs/protocol.md, on the robot's way to a bay and back."""

from collections.abc import Generator
from itertools import pairwise

from onboard.conform.cast import Cast, silent
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import MS, SECOND, Play, Stage, Wait, Word
from onboard.contract.codes import Reason, TokenKind
from onboard.contract.messages import (
    CallForProposals,
    Diagnostic,
    Itinerary,
    Progress,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    TokenSeen,
    Waiting,
)
from onboard.core.token_keys import TokenKey, genesis_holder
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.site import car_park

_REPEAT = "It is said again as in [K3]; all that I repeat together not more often than about once in `T_pace`."
_COUNTS = (
    "A grant counts if it names me, its version is newer than all that I did with "
    "the token, and its sender is whom I believe to hold it."
)
_REFUSED = "Who was refused asks again after `T_token_most`"
_CLAIM = "Who claims a token that I hold is answered with `TokenHeld`, counted and named (`RIGHT_CLAIMED`)."
_DISPUTE = "A grant to me of a newer version from anybody else is answered with `TokenDispute`, naming whom I believe."
_NAMED = "Who is named answers `TokenHeld` where it holds the token, else `TokenGiven` with the last that it gave away"
_MOVES = "I move, or let move, only within segments whose tokens I hold"

ASKING = (
    Check("asks-for-segments-first", "K9", "I ask for a token with `TokenRequest`"),
    Check("request-names-its-plan", "K9", "`itinerary_version` of the plan that needs it"),
    Check(
        "request-names-nobody-before-it",
        "K9",
        ("`predecessor` who passes right before me by the plans that I know, 0 for nobody."),
    ),
    Check("request-names-the-version", "K9", "`version_seen` the newest that I know (its low 20 bits)"),
    Check(
        "asks-only-for-its-way",
        "K15",
        ("A robot asks for what it needs soon (its braking distance and three seconds of way) and four segments more"),
    ),
    Check("asks-not-before-the-award", "K9", "I ask for a token with `TokenRequest`"),
    Check("repeats-soon", "K9", _REPEAT),
    Check("repeats-ever-slower", "K9", _REPEAT),
    Check("stands-without-a-grant", "K2", _MOVES),
    Check("refused-waits", "K11", _REFUSED),
    Check("refused-says-that-it-waits", "P11", "`Waiting` is said once for each wait for a refused segment."),
    Check("refused-for-its-mirror-asks-soon", "K11", "after `T_refused` where the reason is MIRROR_BEHIND"),
)


def asking(stage: Stage, cast: Cast) -> Play:
    """It wins a task, and nobody grants; then all is refused, first for one reason, then for another."""
    desk = Desk(stage, cast, 0x0900, 800)
    desk.place_car()
    cast.answer = silent
    begin_us = stage.now_us
    call, bid = yield from desk.wins()
    if bid is None:
        return
    awarded_us = stage.now_us
    early = [one for one in stage.since(TokenRequest, begin_us) if one.time_us < awarded_us]
    stage.none_of("asks-not-before-the-award", early, "asks before the award")
    first = yield from stage.hears(TokenRequest, within_s=20.0, since_us=awarded_us)
    if first is not None:
        yield from stage.pause(4.5)
        _judge_request(stage, cast, first)
        _judge_repeats(stage, first)
    here = [one for one in stage.since(Progress, awarded_us) if one.message.speed_mm_s]
    stage.none_of("stands-without-a-grant", here, "moves")
    yield from _refused(stage, cast)
    desk.withdraw(call)
    yield from stage.pause(6.0)


def _judge_request(stage: Stage, cast: Cast, first: Word) -> None:
    asked: TokenRequest = first.message
    plan = next((one for one in reversed(stage.words[Itinerary]) if one.time_us <= first.time_us), None)
    stage.judge("asks-for-segments-first", asked.token_kind is TokenKind.SEGMENT, "another kind of token", first)
    version = plan.message.version if plan is not None else -1
    stage.judge("request-names-its-plan", asked.itinerary_version == version, f"the plan is {version}", plan, first)
    stage.judge("request-names-nobody-before-it", asked.predecessor == 0, "nobody else has a plan", first)
    requests = stage.since(TokenRequest, first.time_us)
    wrong = [one for one in requests if one.message.version_seen != cast.holder(_key(one))[1] & 0xFFFFF]
    stage.judge("request-names-the-version", not wrong, "another version than was said", *wrong)
    slots = {one.message.token for one in requests if one.message.token_kind is TokenKind.SEGMENT}
    site = stage.site
    assert hasattr(site, "carrier") and hasattr(site, "tracks")
    speed, brake = site.carrier.speed_mm_s, site.carrier.acceleration_mm_s2
    way = -(-(speed * speed // (2 * brake) + 3 * speed) // site.tracks[asked.token >> 8].pitch_mm)
    stage.judge("asks-only-for-its-way", len(slots) <= way + 4 + 1, f"{len(slots)} segments", *requests)


def _judge_repeats(stage: Stage, first: Word) -> None:
    times = [one.time_us for one in stage.since(TokenRequest, first.time_us) if _key(one) == _key(first)]
    gaps = [(b - a) // MS for a, b in pairwise(times)]
    repeat_ms, late_ms = stage.site.timing.token_repeat_us // MS, stage.means.late_us // MS
    stage.judge("repeats-soon", gaps and gaps[0] <= 1_000 + repeat_ms + late_ms, f"gaps of {gaps} ms", first)
    grows = all(b >= a - late_ms for a, b in pairwise(gaps))
    is_kept = gaps and all(gap >= repeat_ms - late_ms for gap in gaps) and grows
    stage.judge("repeats-ever-slower", is_kept, f"gaps of {gaps} ms", first)


def _refused(stage: Stage, cast: Cast) -> Play:
    cast.answer = lambda _, __: Reason.TOKEN_NOT_GRANTABLE_YET
    asked = yield from stage.hears(TokenRequest, within_s=8.0)
    begin_us = stage.now_us
    again = None
    if asked is not None:
        key = _key(asked)
        again = yield from stage.hears(TokenRequest, lambda one: _same(one, key), 4.2, begin_us + 1)
        stage.judge("refused-waits", again is None, "asks sooner", asked, again)
        yield from stage.pause(1.0)
        told = [one for one in stage.since(Waiting, begin_us) if _slot(one) == asked.message.token]
        stage.judge("refused-says-that-it-waits", len(told) == 1, f"Waiting {len(told)} times", asked, *told)
    cast.answer = lambda _, __: Reason.MIRROR_BEHIND
    asked = yield from stage.hears(TokenRequest, within_s=8.0)
    if asked is not None:
        soon = _key(asked)
        again = yield from stage.hears(TokenRequest, lambda one: _same(one, soon), 3.0, stage.now_us + 1)
        gap_us = 0 if again is None else again.time_us - asked.time_us
        is_kept = 5 * stage.site.timing.token_repeat_us - stage.means.late_us <= gap_us <= 2 * SECOND
        stage.judge("refused-for-its-mirror-asks-soon", is_kept, f"after {gap_us} us", asked, again)


def _same(one: TokenRequest, key: TokenKey) -> bool:
    return (one.token_kind, one.token) == key


def _slot(word: Word) -> int:
    number: int = word.message.track << 8 | word.message.index
    return number


def _key(word: Word) -> TokenKey:
    return TokenKey(word.message.token_kind, word.message.token)


TAKING = (
    Check("grant-to-another-is-not-mine", "K5", _COUNTS),
    Check("grant-of-an-old-version-is-none", "K5", _COUNTS),
    Check("grant-of-who-holds-nothing-is-none", "K5", _COUNTS),
    Check("grant-of-who-holds-nothing-is-disputed", "K7", _DISPUTE),
    Check("dispute-names-whom-it-believes", "K7", _DISPUTE),
    Check("grant-by-a-chain-counts", "K7", "If that chain leads to the giver, the grant counts now."),
    Check("grant-of-a-stranger-is-none", "F2", "I hear only machines of the site file"),
    Check("hint-is-no-right", "K6", "All else is a hint and decides nothing."),
    Check("word-of-a-gift-is-no-grant", "K5", _COUNTS),
    Check("unasked-claim-is-a-hint", "K6", "All else is a hint and decides nothing."),
    Check("grant-is-confirmed", "K5", "journal, hold, say `TokenHeld` under its version."),
    Check("grant-again-is-confirmed-again", "K5", "The same grant again is answered with `TokenHeld` again."),
    Check("grant-of-a-run-is-one-for-each", "F8", ("A word of kind `RUN` is as good as one for each of its segments")),
    Check("run-too-long-is-none", "F8", "One of more is none."),
    Check("moves-when-it-may", "K2", _MOVES),
    Check("keeps-to-its-rights", "K2", _MOVES),
)


def taking(stage: Stage, cast: Cast) -> Play:
    """It asks for its way, and is given what does not count before it is given what does."""
    desk = Desk(stage, cast, 0x0A00, 900)
    desk.place_car()
    cast.answer = silent
    call, bid = yield from desk.wins()
    asked = (yield from stage.hears(TokenRequest, within_s=20.0)) if bid is not None else None
    if asked is None:
        desk.withdraw(call)
        return
    yield from stage.pause(1.0)
    key = _key(asked)
    giver, version = cast.holder(key)
    lies: tuple[tuple[str, TokenGrant | TokenSeen | TokenGiven], ...] = (
        ("grant-of-an-old-version-is-none", TokenGrant(giver, *key, version, stage.node)),
        ("grant-of-a-stranger-is-none", TokenGrant(stage.stranger, *key, version + 1, stage.node)),
        ("hint-is-no-right", TokenSeen(giver, *key, version + 1, stage.node)),
        ("word-of-a-gift-is-no-grant", TokenGiven(giver, *key, version + 1, stage.node)),
    )
    for name, lie in lies:
        yield from _takes_not(stage, name, key, lie)
    yield from _too_long(stage, cast)
    if stage.other:
        yield from _lied_to(stage, cast, key)
    else:
        yield from _granted(stage, cast, key)
    cast.answer = lambda key, _: Reason.NONE if key.kind is TokenKind.SEGMENT else Reason.DOOR_NOT_READY
    yield from stage.pause(0.5)
    moved = yield from stage.hears(Progress, lambda one: one.speed_mm_s != 0, 10.0, asked.time_us)
    stage.judge("moves-when-it-may", moved, "does not move", moved)
    yield from _is_there(stage)
    yield from _given_away(stage, cast, desk, call)


def _takes_not(stage: Stage, name: str, key: TokenKey, lie: TokenGrant | TokenSeen | TokenGiven) -> Play:
    begin_us = stage.now_us
    stage.say(lie)
    yield from stage.pause(0.4)
    stage.none_of(name, [one for one in stage.since(TokenHeld, begin_us) if _key(one) == key], "it took it")


def _too_long(stage: Stage, cast: Cast) -> Play:
    begin_us = stage.now_us
    giver = stage.caller
    stage.say(TokenGrant(giver, TokenKind.RUN, 1 << 16 | 1 << 8 | 20, 9, stage.node))
    yield from stage.pause(0.4)
    stage.none_of("run-too-long-is-none", stage.since(TokenHeld, begin_us), "it took some")
    _ = cast


def _lied_to(stage: Stage, cast: Cast, key: TokenKey) -> Play:
    """Somebody grants what it does not hold; then its holder says that it gave it there."""
    giver, version = cast.holder(key)
    begin_us = stage.now_us
    # It says first that it holds the token, which nobody has asked.
    stage.say(TokenHeld(stage.other, *key, version + 1))
    yield from stage.pause(0.3)
    claim_us = stage.now_us
    stage.say(TokenGrant(stage.other, *key, version + 2, stage.node))
    yield from stage.pause(0.3)
    taken = [one for one in stage.since(TokenHeld, claim_us) if _key(one) == key]
    stage.none_of("unasked-claim-is-a-hint", taken, "it believes who only says so")
    word = yield from stage.hears(TokenDispute, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    stage.judge("grant-of-who-holds-nothing-is-disputed", word, "no TokenDispute within 2 s", word)
    stage.judge("dispute-names-whom-it-believes", word and word.message.believed == giver, f"not {giver}", word)
    held = [one for one in stage.since(TokenHeld, begin_us) if _key(one) == key]
    stage.none_of("grant-of-who-holds-nothing-is-none", held, "it took it")
    stage.say(TokenGiven(giver, *key, version + 1, stage.other))
    word = yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    if word is None:
        stage.say(TokenGrant(stage.other, *key, version + 2, stage.node))
        word = yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    is_taken = word is not None and word.message.version == version + 2
    stage.judge("grant-by-a-chain-counts", is_taken, "it did not take it", word)
    if not is_taken:
        cast.tokens[key] = (stage.other, version + 2)
    yield from _granted(stage, cast, None)


def _granted(stage: Stage, cast: Cast, key: TokenKey | None) -> Play:
    """The next one by its holder, and twice; then a run of all that it asks for."""
    if key is None:
        asked = yield from stage.hears(TokenRequest, lambda one: _is_the_fleets(cast, one), 8.0)
        if asked is None:
            return
        key = _key(asked)
    begin_us = stage.now_us
    said = cast.grant(key, stage.node)
    word = yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    stage.judge("grant-is-confirmed", word and word.message.version == said.version, "not held under its version", word)
    yield from stage.pause(0.5)
    again_us = stage.now_us
    stage.say(said)
    word = yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 2.0, again_us)
    stage.judge("grant-again-is-confirmed-again", word, "no TokenHeld again", word)
    if stage.other:
        yield from _to_another(stage, cast)
    yield from _as_a_run(stage, cast)


def _to_another(stage: Stage, cast: Cast) -> Play:
    asked = yield from stage.hears(TokenRequest, lambda one: _is_the_fleets(cast, one), 8.0)
    if asked is None:
        return
    key, begin_us = _key(asked), stage.now_us
    giver, version = cast.holder(key)
    stage.say(TokenGrant(giver, *key, version + 1, stage.other))
    yield from stage.pause(0.4)
    held = [one for one in stage.since(TokenHeld, begin_us) if _key(one) == key]
    stage.none_of("grant-to-another-is-not-mine", held, "it took it")
    cast.tokens[key] = (stage.other, version + 1)
    stage.say(TokenHeld(stage.other, *key, version + 1))
    yield from stage.pause(0.2)


def _is_the_fleets(cast: Cast, one: TokenRequest) -> bool:
    """A segment of the fleet's; a lift's platform and gate are nobody else's."""
    is_lifts = one.token >> 8 in car_park(cast.stage.site).lifts
    is_segment = one.token_kind is TokenKind.SEGMENT and not is_lifts
    return is_segment and cast.holder(TokenKey(one.token_kind, one.token))[0] in cast.parts


def _as_a_run(stage: Stage, cast: Cast) -> Play:
    """Two segments in line of one giver that it asks for, given as a run."""
    asked = yield from stage.hears(TokenRequest, lambda one: _is_the_fleets(cast, one), 8.0)
    if asked is None:
        return
    yield from stage.pause(0.3)
    wanted = sorted({one.message.token for one in stage.since(TokenRequest, stage.now_us - 6 * SECOND)})
    pairs = [
        (a, b)
        for a, b in pairwise(wanted)
        if b == a + 1 and _giver(cast, a) == _giver(cast, b) and _giver(cast, a) in cast.parts
    ]
    if not pairs:
        return
    low, high = pairs[-1]
    version = 1 + max(cast.holder(TokenKey(TokenKind.SEGMENT, one))[1] for one in (low, high))
    giver, begin_us = _giver(cast, low), stage.now_us
    stage.say(TokenGrant(giver, TokenKind.RUN, low >> 8 << 16 | (high & 0xFF) << 8 | low & 0xFF, version, stage.node))
    yield from stage.pause(0.5)
    held = {one.message.token for one in stage.since(TokenHeld, begin_us)}
    stage.judge(
        "grant-of-a-run-is-one-for-each", {low, high} <= held, "not all of it", *stage.since(TokenHeld, begin_us)
    )


def _giver(cast: Cast, number: int) -> int:
    return cast.holder(TokenKey(TokenKind.SEGMENT, number))[0]


def _is_there(stage: Stage) -> Generator[Wait, None, Word | None]:
    """It stands before the first compartment."""
    bay = stage.site.machines[stage.caller].station
    assert bay is not None

    def is_there(one: Progress) -> bool:
        return (one.track, one.index, one.speed_mm_s) == (bay.track, bay.index, 0)

    return (yield from stage.hears(Progress, is_there, 90.0))


GIVING = (
    Check("holds-what-it-stands-in", "K14", "A robot gives back to its steward what its body has left"),
    Check("gives-back-what-it-left", "K14", "A robot gives back to its steward what its body has left"),
    Check("gives-back-to-the-steward", "K14", "A robot gives back to its steward what its body has left"),
    Check("tells-its-place-before", "P10", ("A robot says it before it gives back segments that it has left since.")),
    Check("gives-under-a-new-version", "K3", "then say `TokenGrant` with a new version and the new holder."),
    Check("gives-again-until-it-is-heard", "K3", "It is said again until the new holder is heard to hold it"),
    Check("gives-again-ever-slower", "K3", "after `T_token`, three times, then twice as long each time"),
    Check(
        "gives-no-more-once-it-is-heard",
        "K3",
        ("It is said again until the new holder is heard to hold it, or to have given it on"),
    ),
    Check(
        "refuses-what-it-stands-in",
        "K11",
        ("A request that cannot be served is answered with `TokenRefusal` and the reason."),
    ),
    Check(
        "refusal-names-who-asked",
        "K11",
        ("A request that cannot be served is answered with `TokenRefusal` and the reason."),
    ),
    Check("answers-only-for-its-own", "K11", ("A request that cannot be served is answered with `TokenRefusal`")),
    Check("claim-of-mine-is-answered", "K8", _CLAIM),
    Check("claim-of-mine-is-counted", "K8", _CLAIM),
    Check("claim-of-mine-takes-nothing", "K2", "A token is never lent, and none ends by time."),
    Check(
        "old-claim-is-corrected",
        "K8",
        ("Who says that it holds one under an older version than I know is answered with `TokenSeen`."),
    ),
    Check("named-holder-says-that-it-holds", "K7", _NAMED),
    Check("named-giver-says-whom-it-gave-to", "K7", _NAMED),
    Check("asks-for-the-bay", "C1", "A robot before a station asks for the tokens of station and car."),
    Check("asks-for-the-car", "C1", "A robot before a station asks for the tokens of station and car."),
)


def _given_away(stage: Stage, cast: Cast, desk: Desk, call: CallForProposals) -> Play:
    """It stands before the bay, whose tokens are refused; what it holds is claimed, asked for and disputed."""
    yield from stage.pause(3.0)
    asked = {one.message.token_kind for one in stage.since(TokenRequest, stage.now_us - 6 * SECOND)}
    for name, kind in (("asks-for-the-bay", TokenKind.STATION), ("asks-for-the-car", TokenKind.CAR)):
        stage.judge(name, kind in asked, "no request for it")
    place = stage.last(Progress)
    assert place is not None
    key = TokenKey(TokenKind.SEGMENT, _slot(place))
    holder, version = cast.holder(key)
    stage.judge("holds-what-it-stands-in", holder == stage.node, f"node {holder} has it", place)
    stage.judge("keeps-to-its-rights", holder == stage.node, "stands where it has no right", place)
    if stage.other:
        yield from _pressed(stage, cast, key, version)
    back = [one for one in stage.since(TokenGrant, stage.begin_us) if one.message.token_kind is TokenKind.SEGMENT]
    stage.judge("gives-back-what-it-left", back, "gave nothing back", *back)
    if back:
        _judge_given(stage, back)
        yield from _named(stage, cast, _key(back[-1]))
    yield from _unheard(stage, cast, desk, call)


def _judge_given(stage: Stage, back: list[Word]) -> None:
    wrong = [
        one for one in back if one.message.holder != genesis_holder(stage.site, _key(one)) and not _is_home(stage, one)
    ]
    stage.judge("gives-back-to-the-steward", not wrong, "to somebody else", *wrong)
    told = [one for one in stage.words[Progress] if one.time_us <= back[-1].time_us]
    is_before = told and back[-1].message.token != _slot(told[-1])
    stage.judge("tells-its-place-before", is_before, "its last place is what it gives back", *told[-1:], back[-1])


def _is_home(stage: Stage, word: Word) -> bool:
    return bool(word.message.token == stage.machine.home.number)


def _pressed(stage: Stage, cast: Cast, key: TokenKey, version: int) -> Play:
    other = stage.other
    stage.say(TokenRequest(other, *key, version & 0xFFFFF, 1, 0))
    word = yield from stage.hears(TokenRefusal, within_s=3.0)
    stage.judge("refuses-what-it-stands-in", word, "no TokenRefusal within 3 s", word)
    if word is not None:
        stage.judge("refusal-names-who-asked", word.message.requester == other, "another", word)
    begin_us = stage.now_us
    free = TokenKey(TokenKind.SEGMENT, key.number & 0xFF00 | 1)
    if cast.holder(free)[0] != stage.node:
        stage.say(TokenRequest(other, *free, 0, 1, 0))
        yield from stage.pause(1.0)
        words = [one for one in stage.since(TokenRefusal, begin_us) if _key(one) == free]
        stage.none_of("answers-only-for-its-own", words, "refuses what it does not hold")
    yield from _claimed(stage, cast, key, version)


def _claimed(stage: Stage, cast: Cast, key: TokenKey, version: int) -> Play:
    begin_us = stage.now_us
    before = stage.count_of(Reason.RIGHT_CLAIMED)
    stage.say(TokenHeld(stage.other, *key, version + 1))
    word = yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    stage.judge("claim-of-mine-is-answered", word, "no TokenHeld within 2 s", word)
    told = yield from stage.hears(Diagnostic, lambda one: one.reason is Reason.RIGHT_CLAIMED, 4.0, begin_us)
    stage.judge("claim-of-mine-is-counted", told and told.message.count != before, "no Diagnostic of it", told)
    begin_us = stage.now_us
    stage.say(TokenDispute(stage.caller, *key, version, stage.node))
    word = yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    stage.judge("named-holder-says-that-it-holds", word, "no TokenHeld within 2 s", word)
    is_kept = word is not None and word.message.version == version
    stage.judge("claim-of-mine-takes-nothing", is_kept, "under another version", word)


def _named(stage: Stage, cast: Cast, key: TokenKey) -> Play:
    """Of what it gave back it is named as the holder; and its new holder says an older version."""
    _, version = cast.holder(key)
    begin_us = stage.now_us
    stage.say(TokenDispute(stage.caller, *key, version, stage.node))
    word = yield from stage.hears(TokenGiven, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
    stage.judge("named-giver-says-whom-it-gave-to", word, "no TokenGiven within 2 s", word)
    if stage.other and version > 1:
        begin_us = stage.now_us
        stage.say(TokenHeld(stage.other, *key, version - 1))
        word = yield from stage.hears(TokenSeen, lambda one: (one.token_kind, one.token) == key, 2.0, begin_us)
        stage.judge("old-claim-is-corrected", word, "no TokenSeen within 2 s", word)


def _unheard(stage: Stage, cast: Cast, desk: Desk, call: CallForProposals) -> Play:
    """The task is taken back; the robot leaves, and nobody confirms what it gives back."""
    cast.confirms = False
    begin_us = stage.now_us
    desk.withdraw(call)
    given = yield from stage.hears(TokenGrant, lambda one: one.token_kind is TokenKind.SEGMENT, 20.0, begin_us)
    if given is None:
        cast.confirms = True
        return
    yield from stage.pause(3.5)
    same = [one for one in stage.since(TokenGrant, given.time_us) if one.message == given.message]
    stage.judge("gives-again-until-it-is-heard", len(same) >= 4, f"{len(same)} times in 3.5 s", *same)
    gaps = [(b.time_us - a.time_us) // MS for a, b in pairwise(same)]
    repeat_ms, late_ms = stage.site.timing.token_repeat_us // MS, stage.means.late_us // MS
    soon = gaps[:1] and abs(gaps[0] - repeat_ms) <= late_ms
    grows = all(b >= a - late_ms for a, b in pairwise(gaps))
    stage.judge("gives-again-ever-slower", soon and grows, f"gaps of {gaps} ms", *same)
    _, version = cast.holder(_key(given))
    stage.judge("gives-under-a-new-version", given.message.version > version, f"not above {version}", given)
    cast.confirms = True
    stage.say(TokenHeld(given.message.holder, *_key(given), given.message.version))
    cast.tokens[_key(given)] = (given.message.holder, given.message.version)
    yield from stage.pause(0.3)
    begin_us = stage.now_us
    yield from stage.pause(6.0)
    same = [one for one in stage.since(TokenGrant, begin_us) if one.message == given.message]
    stage.none_of("gives-no-more-once-it-is-heard", same, "says it still")
    yield from stage.pause(20.0)


SCENES = (
    Scene("asking for rights", ASKING, asking),
    Scene("taking rights", (*TAKING, *GIVING), taking),
)

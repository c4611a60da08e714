"""Memories of others' rights, rights that are made anew, and a journal that is short: chapters 12 and 14."""

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import OPERATOR, SECOND, Play, Stage
from onboard.contract.assignments import assignment_digest
from onboard.contract.codes import MachineState, Reason, RegenerationPhase, TokenKind
from onboard.contract.constants import ACTING
from onboard.contract.messages import (
    Go,
    Halted,
    Heartbeat,
    Itinerary,
    Progress,
    Regeneration,
    RegenerationState,
    SyncDone,
    SyncRequest,
    TokenAssigned,
    TokenGrant,
    TokenHeld,
    TokenRequest,
    TokenSeen,
)
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.desk import Desk

_TOLD = (
    "To its question I add `TokenSeen` for each token that it held by its own word before and does not say now, and "
    "for what it gave away by its own word and nobody has confirmed"
)

MEMORY = (
    Check("tells-what-it-held-before", "R4", _TOLD),
    Check("tells-under-which-version", "R4", _TOLD),
    Check("tells-what-it-gave-unheard", "R4", _TOLD),
    Check("tells-not-what-it-says-itself", "R4", _TOLD),
    Check("answers-who-lives-anew", "R3", "A `SyncRequest` to me or to all is answered with what I vouch for"),
    Check("newcomer-is-asked-in-turn", "R5", "else `T_new` and my turn later"),
    Check("answered-newcomer-is-not-asked", "R5", "unless its answer to another came first."),
)


def memory(stage: Stage, cast: Cast) -> Play:
    """A machine had rights, lives anew, and does not say all of them."""
    desk = Desk(stage, cast)
    other, caller, part = stage.other, stage.caller, cast.parts[stage.other]
    track = desk.bay.track
    free = [index for index in range(1, desk.site.tracks[track].length + 1) if not _is_used(cast, desk, index)]
    forgotten, given, kept = (TokenKey(TokenKind.SEGMENT, track << 8 | index) for index in free[:3])
    versions = {}
    for key in (forgotten, given, kept):
        version = cast.holder(key)[1] + 3
        versions[key] = version
        stage.say(TokenGrant(cast.holder(key)[0], *key, version, other), TokenHeld(other, *key, version))
        cast.tokens[key] = (caller, version)
    stage.say(TokenGrant(other, *given, versions[given] + 1, caller))
    yield from stage.pause(3.0)
    part.lives_anew()
    part.state = MachineState.STARTING
    begin_us = stage.now_us
    part.answers = False
    cast.beat(part)
    stage.say(TokenHeld(other, *kept, versions[kept]), SyncRequest(other, 0))
    yield from stage.pause(0.6)
    stage.say(SyncDone(other, 0, part.boot, 0))
    done = yield from stage.hears(SyncDone, within_s=3.0, since_us=begin_us)
    yield from stage.pause(2.0)
    stage.judge("answers-who-lives-anew", done, "no SyncDone within 3 s", done)
    seen = {TokenKey(one.message.token_kind, one.message.token): one for one in stage.since(TokenSeen, begin_us)}
    for name, key in (("tells-what-it-held-before", forgotten), ("tells-what-it-gave-unheard", given)):
        stage.judge(name, key in seen, f"no TokenSeen of {key}", *seen.values())
    if forgotten in seen:
        told = seen[forgotten].message
        is_so = (told.version, told.holder) == (versions[forgotten], other)
        stage.judge("tells-under-which-version", is_so, f"not {versions[forgotten]} of {other}", seen[forgotten])
    stage.judge("tells-not-what-it-says-itself", kept not in seen, "tells what was just said", seen.get(kept))
    part.state, part.answers = MachineState.IDLE, True
    cast.beat(part)
    yield from stage.pause(3.0)
    for key in (forgotten, given, kept):
        version = versions[key] + 2
        stage.say(TokenGrant(other, *key, version, caller), TokenHeld(caller, *key, version))
        cast.tokens[key] = (caller, version)
    yield from stage.pause(3.0)
    yield from _newcomer(stage, cast)


def _is_used(cast: Cast, desk: Desk, index: int) -> bool:
    return cast.holder(TokenKey(TokenKind.SEGMENT, desk.bay.track << 8 | index))[0] not in cast.parts


def _newcomer(stage: Stage, cast: Cast) -> Play:
    """Machines come for the first time in their life: one that nobody asks, and one that has told all already."""
    part = cast.parts[stage.other]
    for name, answers in (("newcomer-is-asked-in-turn", False), ("answered-newcomer-is-not-asked", True)):
        part.is_there = False
        yield from stage.pause(9.0)
        part.is_there = True
        begin_us = stage.now_us
        part.lives_anew()
        cast.beat(part)
        if answers:
            yield from stage.pause(0.1)
            asked_us = stage.now_us
            stage.say(SyncDone(part.node, 0, part.boot, 0))
            yield from stage.pause(3.0)
            asks = [one for one in stage.since(SyncRequest, asked_us + 200_000) if one.message.whom == part.node]
            stage.none_of(name, asks, "asks who has told all")
        else:
            yield from stage.pause(3.0)
            asks = [one for one in stage.since(SyncRequest, begin_us) if one.message.whom == part.node]
            stage.judge(name, asks, "is not asked", *asks)


_READ = "journal the list, answer `RegenerationState` READ_BACK with the same number and digest"
_COUNTS = "the list counts; the new epoch is journalled and said in heartbeats."
_SAYS = "each says `TokenHeld` for what it holds, `TokenSeen` for all that it gave or saw given"

REGENERATED = (
    Check("frozen-says-all-that-it-holds", "G2", _SAYS),
    Check("frozen-says-what-it-saw", "G2", _SAYS),
    Check("frozen-asks-for-nothing", "G1", "stand where they can, grant and take nothing"),
    Check("frozen-takes-nothing", "G1", "stand where they can, grant and take nothing"),
    Check("list-is-read-back", "G3", _READ),
    Check("list-has-its-number", "G3", _READ),
    Check("list-has-its-digest", "G3", _READ),
    Check("incomplete-list-is-told-as-it-is", "G3", _READ),
    Check(
        "read-back-outlasts-T-frozen",
        "G5",
        "A freeze that is not said again for `T_frozen` is over, unless the list was read back",
    ),
    Check("read-back-counts-not-yet", "G4", "the list counts; the new epoch is journalled and said in heartbeats."),
    Check("commit-is-answered", "G4", _COUNTS),
    Check("new-epoch-is-told", "G4", _COUNTS),
    Check("assigned-right-counts", "G4", _COUNTS),
    Check("old-epoch-is-an-obstacle", "G4", "A machine of an older epoch is an obstacle (OTHER_EPOCH)"),
    Check("takes-part-in-the-new-epoch", "G4", _COUNTS),
    Check("old-freeze-is-refused", "G1", "or has a foreign journal, answers REFUSED"),
)


def regenerated(stage: Stage, cast: Cast) -> Play:
    """An operator makes the rights of a machine anew, to the end."""
    desk = Desk(stage, cast, 0x1500, 2_000)
    lost, epoch = stage.other, stage.epoch + 1
    track = desk.bay.track
    free = next(index for index in range(1, desk.site.tracks[track].length + 1) if not _is_used(cast, desk, index))
    key = TokenKey(TokenKind.SEGMENT, track << 8 | free)
    version = cast.holder(key)[1] + 2
    stage.say(TokenGrant(cast.holder(key)[0], *key, version, lost), TokenHeld(lost, *key, version))
    cast.tokens[key] = (lost, version)
    cast.parts[lost].is_there = False
    yield from stage.pause(8.0)
    mine = cast.held_by(stage.node)
    begin_us = stage.now_us
    _stands(cast)
    _says(stage, RegenerationPhase.FREEZE, epoch, lost)
    yield from stage.pause(2.0)
    said = {TokenKey(one.message.token_kind, one.message.token) for one in stage.since(TokenHeld, begin_us)}
    stage.judge("frozen-says-all-that-it-holds", set(mine) <= said, f"not {sorted(set(mine) - said)}")
    seen = {TokenKey(one.message.token_kind, one.message.token) for one in stage.since(TokenSeen, begin_us)}
    stage.judge("frozen-says-what-it-saw", key in seen, f"no TokenSeen of {key}")
    target = TokenKey(TokenKind.SEGMENT, key.number)
    stage.say(TokenGrant(stage.caller, *_another(cast, desk, free), 900, stage.node))
    yield from stage.pause(1.0)
    took = [one for one in stage.since(TokenHeld, stage.now_us - SECOND) if one.message.version == 900]
    stage.none_of("frozen-takes-nothing", took, "takes a right")
    stage.none_of("frozen-asks-for-nothing", stage.since(TokenRequest, begin_us), "asks for rights")
    lines = (
        TokenAssigned(OPERATOR, *target, 5_000, stage.caller),
        TokenAssigned(OPERATOR, *_free(cast, desk, free), 5_000, stage.node),
    )
    yield from _list(stage, epoch, lost, lines)
    yield from _committed(stage, cast, epoch, lost, lines)
    bid = yield from desk.asks(desk.call())
    stage.judge("takes-part-in-the-new-epoch", bid, "no bid", bid)
    begin_us = stage.now_us
    _says(stage, RegenerationPhase.FREEZE, epoch, lost)
    state = yield from stage.hears(RegenerationState, within_s=3.0, since_us=begin_us)
    is_refused = state is not None and state.message.regeneration_phase is RegenerationPhase.REFUSED
    stage.judge("old-freeze-is-refused", is_refused, "not REFUSED", state)
    yield from stage.pause(2.0)


def _stands(cast: Cast) -> None:
    """All others stand as well: who works in the old epoch ends it."""
    for part in cast.parts.values():
        part.state = MachineState.OBSTACLE
        if part.is_there:
            cast.beat(part)


def _another(cast: Cast, desk: Desk, but: int) -> TokenKey:
    return _free(cast, desk, but, 1)


def _free(cast: Cast, desk: Desk, but: int, number: int = 0) -> TokenKey:
    length = desk.site.tracks[desk.bay.track].length
    free = [index for index in range(1, length + 1) if index != but and not _is_used(cast, desk, index)]
    return TokenKey(TokenKind.SEGMENT, desk.bay.track << 8 | free[number])


def _says(stage: Stage, phase: RegenerationPhase, epoch: int, lost: int, tokens: int = 0, digest: int = 0) -> None:
    stage.say(Regeneration(OPERATOR, phase, epoch, lost, lost if lost != stage.node else 0, tokens, digest))


def _list(stage: Stage, epoch: int, lost: int, lines: tuple[TokenAssigned, ...]) -> Play:
    digest = assignment_digest(lines)
    stage.say(lines[0])
    begin_us = stage.now_us
    _says(stage, RegenerationPhase.READ_BACK, epoch, lost, len(lines), digest)
    state = yield from stage.hears(RegenerationState, within_s=3.0, since_us=begin_us)
    is_one = state is not None and state.message.tokens == 1
    stage.judge("incomplete-list-is-told-as-it-is", is_one, "not one line", state)
    yield from stage.pause(0.1)
    stage.say(*lines)
    begin_us = stage.now_us
    _says(stage, RegenerationPhase.READ_BACK, epoch, lost, len(lines), digest)
    state = yield from stage.hears(RegenerationState, within_s=3.0, since_us=begin_us)
    is_read = state is not None and state.message.regeneration_phase is RegenerationPhase.READ_BACK
    stage.judge("list-is-read-back", is_read, "no READ_BACK", state)
    stage.judge("list-has-its-number", state and state.message.tokens == len(lines), f"not {len(lines)}", state)
    stage.judge("list-has-its-digest", state and state.message.digest == digest, f"not {digest:04X}", state)
    yield from stage.pause(13.0)
    acts = [one for one in stage.since(Heartbeat, stage.now_us - 3 * SECOND) if one.message.state in ACTING]
    stage.none_of("read-back-outlasts-T-frozen", acts, "goes on by itself")
    beats = [one for one in stage.since(Heartbeat, begin_us) if one.message.epoch == epoch]
    stage.none_of("read-back-counts-not-yet", beats, "says the new epoch")


def _committed(stage: Stage, cast: Cast, epoch: int, lost: int, lines: tuple[TokenAssigned, ...]) -> Play:
    begin_us = stage.now_us
    stage.epoch = epoch
    _says(stage, RegenerationPhase.COMMIT, epoch, lost, len(lines), assignment_digest(lines))
    for part in cast.parts.values():
        part.epoch, part.is_there, part.state = epoch, True, MachineState.IDLE
        cast.beat(part)
    for line in lines:
        cast.tokens[TokenKey(line.token_kind, line.token)] = (line.holder, line.version)
    state = yield from stage.hears(RegenerationState, within_s=3.0, since_us=begin_us)
    is_done = state is not None and state.message.regeneration_phase is RegenerationPhase.COMMIT
    stage.judge("commit-is-answered", is_done, "no COMMIT", state)
    beat = yield from stage.hears(Heartbeat, lambda one: one.epoch == epoch, 5.0, begin_us)
    stage.judge("new-epoch-is-told", beat, "never tells it", beat)
    yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 12.0, begin_us)
    begin_us = stage.now_us
    stage.say(SyncRequest(stage.caller, stage.node))
    key = (lines[1].token_kind, lines[1].token)
    yield from stage.pause(2.0)
    # It holds it, or has given it back already, as it does not need it.
    said = [*stage.since(TokenHeld, begin_us - 6 * SECOND), *stage.since(TokenGrant, begin_us - 12 * SECOND)]
    counts = [one for one in said if (one.message.token_kind, one.message.token) == key]
    is_its = any(one.message.version >= lines[1].version for one in counts)
    stage.judge("assigned-right-counts", is_its, "neither holds it nor gives it back", *counts)
    for part in cast.parts.values():
        part.epoch = epoch - 1
        cast.beat(part)
    yield from stage.pause(5.0)
    beats = stage.since(Heartbeat, stage.now_us - 2 * SECOND)
    is_held = beats and beats[-1].message.state is MachineState.OBSTACLE
    stage.judge("old-epoch-is-an-obstacle", is_held, "takes part with machines of an older epoch", *beats)
    for part in cast.parts.values():
        part.epoch = epoch
        cast.beat(part)
    yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 15.0)
    yield from stage.pause(4.0)


_OLD = (
    "Whoever is told by a machine that has not answered yet of a newer version of a right that its journal says is its "
    "own has an old journal"
)
_LIFE = (
    "So does, with JOURNAL_LOST, whom `SyncRequest.boot_before` names a life that its journal lacks, within "
    "`T_compare` of its start."
)
SHORT = (
    Check("short-journal-is-told", "R7", _OLD),
    Check("short-journal-needs-a-person", "R7", "holds for a person, and uses no right."),
    Check("short-journal-uses-no-right", "R7", "holds for a person, and uses no right."),
    Check("short-journal-goes-not-by-go", "H4", "but for a lost, short or foreign journal"),
    Check("short-journal-outlasts-a-restart", "H4", "A hold for a person is in the journal and outlives a restart"),
    Check("forgotten-life-is-told", "R7", _LIFE),
    Check("forgotten-life-uses-no-right", "R7", "holds for a person, and uses no right."),
    Check("known-life-is-no-news", "R7", _LIFE),
    Check("rights-are-made-anew", "G4", _COUNTS),
    Check("acts-with-rights-made-anew", "G4", _COUNTS),
)


def short(stage: Stage, cast: Cast) -> Play:
    """Somebody knows a newer version of the right to where it stands; then its rights are made anew."""
    desk = Desk(stage, cast, 0x1600, 2_100)
    place = stage.last(Progress)
    if place is None:
        return
    here = desk.segment_key(place.message.track, place.message.index)
    version = cast.holder(here)[1]
    for number in range(2):
        stage.switch(on=False)
        yield from stage.pause(1.0)
        part = cast.parts[stage.other]
        part.answers = number > 0
        begin_us = stage.now_us
        stage.switch(on=True)
        asked = yield from stage.hears(SyncRequest, lambda one: one.whom == 0, 5.0, begin_us)
        if asked is not None and number == 0:
            stage.say(TokenHeld(stage.other, *here, version + 7), SyncDone(stage.other, stage.node, part.boot, 0))
            part.answers = True
        word = yield from stage.hears(Halted, lambda one: one.machine == stage.node, 12.0, begin_us)
        is_short = word is not None and word.message.reason is Reason.JOURNAL_SHORT
        if number:
            stage.judge("short-journal-outlasts-a-restart", is_short, "no Halted JOURNAL_SHORT", word)
            break
        stage.judge("short-journal-is-told", is_short, "no Halted JOURNAL_SHORT within 12 s", word)
        stage.judge("short-journal-needs-a-person", word and word.message.needs_person, "needs nobody", word)
        yield from stage.pause(5.0)
        stage.say(Go(OPERATOR, stage.node))
        yield from stage.pause(8.0)
        acts = [one for one in stage.since(Heartbeat, stage.now_us - 8 * SECOND) if one.message.state in ACTING]
        stage.none_of("short-journal-goes-not-by-go", acts, "goes on")
        uses = [*stage.since(TokenRequest, begin_us), *stage.since(TokenGrant, begin_us)]
        plans = [one for one in stage.since(Itinerary, begin_us) if len(one.message.legs) > 1]
        stage.none_of("short-journal-uses-no-right", [*uses, *plans], "uses rights")
    yield from _healed(stage, cast, desk, here, version)
    yield from _forgotten(stage, cast, desk, here)


def _forgotten(stage: Stage, cast: Cast, desk: Desk, here: TokenKey) -> Play:
    """It lives anew twice: somebody has known the life before this one, then one that it does not know."""
    for newer in (0, 3):
        stage.switch(on=False)
        yield from stage.pause(1.0)
        begin_us = stage.now_us
        stage.switch(on=True)
        asked = yield from stage.hears(SyncRequest, lambda one: one.whom == 0, 5.0, begin_us)
        beat = stage.last(Heartbeat)
        if asked is None or beat is None:
            return
        known = (beat.message.boot + newer - (0 if newer else 2)) % 255 + 1
        stage.say(SyncRequest(stage.caller, stage.node, known))
        word = yield from stage.hears(Halted, lambda one: one.machine == stage.node, 6.0, begin_us)
        if not newer:
            stage.judge("known-life-is-no-news", word is None, "takes its journal for short", word)
            yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 12.0, begin_us)
            yield from stage.pause(10.0)
            continue
        is_lost = word is not None and word.message.reason is Reason.JOURNAL_LOST
        stage.judge("forgotten-life-is-told", is_lost, "no Halted JOURNAL_LOST", word)
        yield from stage.pause(5.0)
        acts = [one for one in stage.since(Heartbeat, begin_us) if one.message.state in ACTING]
        uses = [*stage.since(TokenRequest, begin_us), *stage.since(TokenGrant, begin_us), *acts]
        stage.none_of("forgotten-life-uses-no-right", uses, "uses rights")
    yield from _healed(stage, cast, desk, here, cast.holder(here)[1])


def _healed(stage: Stage, cast: Cast, desk: Desk, here: TokenKey, version: int) -> Play:
    epoch = stage.epoch + 1
    lines = tuple(
        TokenAssigned(OPERATOR, *key, max(version, 6_000) + 10, holder)
        for key, holder in (
            (here, stage.node),
            *((key, stage.caller) for key in cast.held_by(stage.node) if key != here),
        )
    )
    _stands(cast)
    for _ in range(3):
        _says(stage, RegenerationPhase.FREEZE, epoch, stage.node)
        yield from stage.pause(1.0)
    stage.say(*lines)
    digest = assignment_digest(lines)
    _says(stage, RegenerationPhase.READ_BACK, epoch, stage.node, len(lines), digest)
    yield from stage.pause(1.0)
    begin_us, stage.epoch = stage.now_us, epoch
    _says(stage, RegenerationPhase.COMMIT, epoch, stage.node, len(lines), digest)
    for line in lines:
        cast.tokens[TokenKey(line.token_kind, line.token)] = (line.holder, line.version)
    for part in cast.parts.values():
        part.epoch, part.state = epoch, MachineState.IDLE
        cast.beat(part)
    beat = yield from stage.hears(Heartbeat, lambda one: one.epoch == epoch, 6.0, begin_us)
    stage.judge("rights-are-made-anew", beat, "never tells the new epoch", beat)
    acts = yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 25.0, begin_us)
    stage.judge("acts-with-rights-made-anew", acts, "does not act within 25 s", acts)
    yield from stage.pause(4.0)
    _ = desk


LAST = (
    Scene("memories of rights", MEMORY, memory, needs_other=True),
    Scene("rights made anew", REGENERATED, regenerated, needs_other=True),
    Scene("a short journal", SHORT, short, needs_power=True, needs_other=True),
)

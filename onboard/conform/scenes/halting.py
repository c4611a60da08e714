"""Stops, a second node of one number, foreign machines, a jump of time, a freeze: chapters 2, 3, 13 and 14."""

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import OPERATOR, SECOND, Heard, Play, Stage, Word
from onboard.contract.codes import MachineState, Reason, RegenerationPhase, TokenKind
from onboard.contract.constants import ACTING
from onboard.contract.messages import (
    EmergencyStop,
    Go,
    Halted,
    Heartbeat,
    Progress,
    Regeneration,
    RegenerationState,
    SyncRequest,
    TokenHeld,
)

_HOLDS = (
    "`EmergencyStop` holds me, whoever says it, by name, until an operator's `Go` "
    "names its sender (or 0: all), or until `T_stop` after it was last heard."
)
_SAYS = (
    "A held machine says its heartbeat with state OBSTACLE and, with each, `Halted`"
    " of itself: reason, `cause` the node that brought it about, `needs_person`."
)

STOPPED = (
    Check("stop-is-obeyed", "H2", _SAYS),
    Check("stop-is-told", "H2", _SAYS),
    Check("stop-tells-whose-it-is", "H2", _SAYS),
    Check("stop-needs-no-person", "H2", _SAYS),
    Check("stop-is-told-with-each-beat", "H2", _SAYS),
    Check("go-for-another-is-none", "H1", _HOLDS),
    Check(
        "go-of-a-machine-is-none",
        "F2",
        ("each only with messages whose senders in the DBC (`BO_TX_BU_`) name its kind"),
    ),
    Check("go-of-an-operator-counts", "H1", _HOLDS),
    Check("listens-before-it-goes-on", "H2", "It listens for `T_listen` before it goes on."),
    Check("stop-of-a-stranger-counts", "F2", "`EmergencyStop` counts from anybody."),
    Check("go-for-all-counts", "H1", _HOLDS),
    Check("stop-of-a-machine-counts", "H1", _HOLDS),
    Check("stop-holds-for-long", "H1", _HOLDS),
    Check("stop-ends-by-itself", "H1", _HOLDS),
    Check(
        "answers-while-it-is-held",
        "J10",
        ("An obstacle moves nothing, bids for nothing and opens no call; it answers questions"),
    ),
)


def _is_held(one: Heartbeat) -> bool:
    return one.state is MachineState.OBSTACLE


def _acts(one: Heartbeat) -> bool:
    return one.state in ACTING


def stopped(stage: Stage, cast: Cast) -> Play:
    """Stops of an operator, a stranger and a machine, and what lifts them."""
    stage.say(EmergencyStop(OPERATOR, Reason.OPERATOR))
    begin_us = stage.now_us
    held = yield from stage.hears(Heartbeat, _is_held, 3.0)
    stage.judge("stop-is-obeyed", held, "no heartbeat of an obstacle within 3 s", held)
    word = yield from stage.hears(Halted, lambda one: one.machine == stage.node, 3.0, begin_us)
    is_told = word is not None and word.message.reason is Reason.EMERGENCY_STOP
    stage.judge("stop-is-told", is_told, "no Halted of itself with this reason", word)
    if word is not None:
        stage.judge("stop-tells-whose-it-is", word.message.cause == OPERATOR, "another cause", word)
        stage.judge("stop-needs-no-person", not word.message.needs_person, "says that it needs a person", word)
    begin_us = stage.now_us
    stage.say(Go(OPERATOR, stage.caller))
    yield from stage.pause(7.0)
    beats, words = stage.since(Heartbeat, begin_us), stage.since(Halted, begin_us)
    is_each = beats and abs(len(words) - len(beats)) <= 1
    stage.judge("stop-is-told-with-each-beat", is_each, f"{len(words)} of {len(beats)}", *beats, *words)
    stage.none_of("go-for-another-is-none", [one for one in beats if _acts(one.message)], "goes on")
    begin_us = stage.now_us
    stage.say(Go(stage.caller, OPERATOR), SyncRequest(stage.caller, stage.node))
    yield from stage.pause(5.0)
    beats = stage.since(Heartbeat, begin_us)
    stage.none_of("go-of-a-machine-is-none", [one for one in beats if _acts(one.message)], "goes on")
    stage.judge("answers-while-it-is-held", stage.since(Progress, begin_us), "does not answer")
    begin_us = stage.now_us
    stage.say(Go(OPERATOR, OPERATOR))
    acts = yield from stage.hears(Heartbeat, _acts, 8.0)
    stage.judge("go-of-an-operator-counts", acts, "does not go on within 8 s", acts)
    if acts is not None:
        stage.judge("listens-before-it-goes-on", acts.time_us - begin_us >= 2 * SECOND - 50_000, "at once", acts)
    yield from _other_stops(stage, cast)


def _other_stops(stage: Stage, _: Cast) -> Play:
    for name, sender in (("stop-of-a-stranger-counts", stage.stranger), ("stop-of-a-machine-counts", stage.caller)):
        begin_us = stage.now_us
        stage.say(EmergencyStop(sender, Reason.OPERATOR))
        held = yield from stage.hears(Heartbeat, _is_held, 3.0)
        stage.judge(name, held, "no heartbeat of an obstacle within 3 s", held)
        if sender == stage.stranger:
            stage.say(Go(OPERATOR, 0))
            acts = yield from stage.hears(Heartbeat, _acts, 8.0)
            stage.judge("go-for-all-counts", acts, "does not go on within 8 s", acts)
            yield from stage.pause(2.0)
            continue
        yield from stage.pause(25.0)
        went_on = [one for one in stage.since(Heartbeat, begin_us + SECOND) if _acts(one.message)]
        stage.none_of("stop-holds-for-long", went_on, "goes on before T_stop")
        acts = yield from stage.hears(Heartbeat, _acts, 15.0)
        stage.judge("stop-ends-by-itself", acts, "does not go on 40 s after the stop", acts)


_OWN = "A frame under my own node-ID holds me (DUPLICATE_NODE_ID)"
_BACK = (
    "I go on by myself, under a new boot counter and as after a restart, when "
    "nobody has sent under my number for `T_quiet`"
)
_PERSON = (
    "If such a frame made or moved a right (`TokenGrant`, `TokenHeld`, `CarAt` or "
    "`Award` that I never said), or they go on for `T_twin`, a person is needed."
)

OWN_NUMBER = (
    Check("own-number-holds-it", "H3", _OWN),
    Check("own-number-is-told", "H3", _OWN),
    Check("not-back-before-T-quiet", "H3", _BACK),
    Check("back-when-it-is-quiet", "H3", _BACK),
    Check("back-under-a-new-boot", "H3", _BACK),
    Check("back-as-after-a-restart", "H3", _BACK),
    Check("own-right-needs-a-person", "H3", _PERSON),
    Check("own-right-waits-for-a-person", "H3", _PERSON),
    Check("go-to-its-number-ends-it", "H4", "`Go` that names my own number ends it"),
)


def own_number(stage: Stage, cast: Cast) -> Play:
    """Somebody else speaks under the node's number: a sign of life, then a right."""
    last = stage.last(Heartbeat)
    if last is None:
        return
    begin_us = stage.now_us
    stage.say(SyncRequest(stage.node, stage.caller))
    held = yield from stage.hears(Heartbeat, _is_held, 3.0)
    stage.judge("own-number-holds-it", held, "no heartbeat of an obstacle within 3 s", held)
    word = yield from _halted(stage, begin_us)
    stage.judge("own-number-is-told", _is_for(word, Reason.DUPLICATE_NODE_ID), "no Halted for this reason", word)
    acts = yield from stage.hears(Heartbeat, _acts, 25.0, begin_us + SECOND)
    stage.judge("back-when-it-is-quiet", acts, "not back within 25 s", acts)
    if acts is not None:
        soon_us = acts.time_us - begin_us
        stage.judge("not-back-before-T-quiet", soon_us >= 3 * stage.site.timing.heartbeat_us, "sooner", acts)
        grown = acts.message.boot == last.message.boot % 255 + 1
        stage.judge("back-under-a-new-boot", grown, "not one more", last, acts)
        asks = [one for one in stage.since(SyncRequest, begin_us + SECOND) if one.message.whom == 0]
        stage.judge("back-as-after-a-restart", asks, "asks nobody", *asks)
    yield from stage.pause(4.0)
    begin_us = stage.now_us
    stage.say(TokenHeld(stage.node, TokenKind.SEGMENT, stage.machine.home.number & 0xFF00 | 1, 77))
    word = yield from _halted(stage, begin_us)
    stage.judge("own-right-needs-a-person", word and word.message.needs_person, "needs nobody", word)
    yield from stage.pause(12.0)
    went_on = [one for one in stage.since(Heartbeat, begin_us + SECOND) if _acts(one.message)]
    stage.none_of("own-right-waits-for-a-person", went_on, "goes on by itself")
    stage.say(Go(OPERATOR, stage.node))
    acts = yield from stage.hears(Heartbeat, _acts, 20.0)
    stage.judge("go-to-its-number-ends-it", acts, "does not go on within 20 s", acts)
    yield from stage.pause(5.0)


def _halted(stage: Stage, begin_us: int) -> Heard:
    return (yield from stage.hears(Halted, lambda one: one.machine == stage.node, 3.0, begin_us))


def _is_for(word: Word | None, reason: Reason) -> bool:
    return word is not None and word.message.reason is reason


_MORE = (
    "Where more machines that live are strangers to me than not (of two halves that"
    " with the lowest node-ID counts), I am the obstacle."
)

FOREIGN = (
    Check("outvoted-by-another-contract", "J8", _MORE),
    Check("back-among-its-own", "J8", _MORE),
    Check("outvoted-by-another-site", "J8", _MORE),
    Check("outvoted-by-another-epoch", "J8", _MORE),
    Check("strangers-have-no-vote", "J8", "Only machines of the site have a vote."),
)


def foreign(stage: Stage, cast: Cast) -> Play:
    """All others are strangers to it, for one reason after another; then there is one that the site does not have."""
    for name, changes in (
        ("outvoted-by-another-contract", ("contract", 1)),
        ("outvoted-by-another-site", ("site_digest", 1)),
        ("outvoted-by-another-epoch", ("epoch", 200)),
    ):
        for part in cast.parts.values():
            setattr(part, changes[0], getattr(part, changes[0]) ^ changes[1])
        held = yield from stage.hears(Heartbeat, _is_held, 8.0)
        stage.judge(name, held, "no heartbeat of an obstacle within 8 s", held)
        for part in cast.parts.values():
            setattr(part, changes[0], getattr(part, changes[0]) ^ changes[1])
        acts = yield from stage.hears(Heartbeat, _acts, 15.0)
        if name == "outvoted-by-another-contract":
            stage.judge("back-among-its-own", acts, "does not go on within 15 s", acts)
        yield from stage.pause(3.0)
    begin_us, node = stage.now_us, stage.stranger
    last = stage.last(Heartbeat)
    for number in range(4):
        if last is not None:
            for sender in (node, node - 1, node - 2, node - 3):
                stage.say(
                    Heartbeat(sender, last.message.contract ^ 1, 1, number, 1, last.message.kind, MachineState.IDLE)
                )
        yield from stage.pause(1.5)
    strange = [one for one in stage.since(Heartbeat, begin_us) if _is_held(one.message)]
    stage.none_of("strangers-have-no-vote", strange, "takes itself for the stranger")


_SLEPT = (
    "it is an obstacle first, says so in a heartbeat (state OBSTACLE), asks each "
    "machine that it knew (`SyncRequest`), counts all silences from now, and "
    "listens for `T_listen`."
)

JUMP = (
    Check("jump-makes-it-an-obstacle", "T3", "Whoever's clock was set anew has slept ([J9])."),
    Check("slept-asks-each", "J9", _SLEPT),
    Check("slept-listens", "J9", _SLEPT),
    Check(
        "slept-comes-back", "J9", ("Then, not before its clock is right, its next heartbeat says that it takes part.")
    ),
)


def jump(stage: Stage, cast: Cast) -> Play:
    """Bus time goes on by half a minute."""
    stage.jumped_us += 30 * SECOND
    begin_us = cast.time_due_us = stage.now_us
    yield from stage.pause(0.2)
    cast.time_due_us = stage.now_us
    held = yield from stage.hears(Heartbeat, _is_held, 5.0)
    stage.judge("jump-makes-it-an-obstacle", held, "no heartbeat of an obstacle within 5 s", held)
    yield from stage.pause(1.0)
    asked = {one.message.whom for one in stage.since(SyncRequest, begin_us)}
    stage.judge(
        "slept-asks-each", set(cast.parts) <= asked, f"asked {sorted(asked)}", *stage.since(SyncRequest, begin_us)
    )
    acts = yield from stage.hears(Heartbeat, _acts, 12.0, begin_us + SECOND)
    stage.judge("slept-comes-back", acts, "does not take part within 12 s", acts)
    if acts is not None and held is not None:
        stage.judge("slept-listens", acts.time_us - held.time_us >= 2 * SECOND - 100_000, "at once", held, acts)
    yield from stage.pause(3.0)


_FROZEN = "stand where they can, grant and take nothing, answer `RegenerationState` FREEZE"

FREEZE = (
    Check("freeze-is-answered", "G1", _FROZEN),
    Check("freeze-names-the-epoch", "G1", _FROZEN),
    Check("freeze-tells-what-it-holds", "G2", "each says `TokenHeld` for what it holds"),
    Check(
        "freeze-of-who-lives-is-refused",
        "G1",
        ("who is declared dead and lives, or has a foreign journal, answers REFUSED"),
    ),
    Check(
        "freeze-of-a-machine-is-none",
        "F2",
        ("each only with messages whose senders in the DBC (`BO_TX_BU_`) name its kind"),
    ),
    Check("freeze-ends-by-abort", "G5", "ABORT, and nothing has changed."),
    Check("abort-changes-no-epoch", "G5", "ABORT, and nothing has changed."),
    Check("freeze-ends-by-itself", "G5", "A freeze that is not said again for `T_frozen` is over"),
)


def freeze(stage: Stage, cast: Cast) -> Play:
    """An operator begins to make rights anew, and does not end it."""
    epoch = (stage.words[Heartbeat][-1].message.epoch if stage.words[Heartbeat] else 0) + 1
    lost = stage.other
    phase = RegenerationPhase.FREEZE

    def say(sender: int, phase: RegenerationPhase, absent: int = 0) -> None:
        stage.say(Regeneration(sender, phase, epoch, lost, absent, 0, 0))

    begin_us = stage.now_us
    say(stage.caller, phase)
    yield from stage.pause(2.0)
    stage.none_of("freeze-of-a-machine-is-none", stage.since(RegenerationState, begin_us), "it answered")
    begin_us = stage.now_us
    say(OPERATOR, phase)
    state = yield from stage.hears(RegenerationState, within_s=5.0)
    is_frozen = state is not None and state.message.regeneration_phase is phase
    stage.judge("freeze-is-answered", is_frozen, "no RegenerationState FREEZE within 5 s", state)
    stage.judge("freeze-names-the-epoch", state and state.message.epoch == epoch, f"not {epoch}", state)
    yield from stage.pause(1.0)
    told = stage.since(TokenHeld, begin_us)
    stage.judge("freeze-tells-what-it-holds", told, "no TokenHeld")
    for _ in range(3):
        say(OPERATOR, RegenerationPhase.ABORT)
    acts = yield from stage.hears(Heartbeat, _acts, 10.0)
    stage.judge("freeze-ends-by-abort", acts, "does not go on within 10 s", acts)
    stage.judge("abort-changes-no-epoch", acts and acts.message.epoch == epoch - 1, "another epoch", acts)
    yield from stage.pause(3.0)
    begin_us = stage.now_us
    say(OPERATOR, phase, stage.node)
    state = yield from stage.hears(RegenerationState, within_s=5.0)
    is_refused = state is not None and state.message.regeneration_phase is RegenerationPhase.REFUSED
    stage.judge("freeze-of-who-lives-is-refused", is_refused, "not REFUSED", state)
    for _ in range(3):
        say(OPERATOR, RegenerationPhase.ABORT)
    yield from stage.pause(4.0)
    say(OPERATOR, phase)
    yield from stage.pause(13.0)
    acts = yield from stage.hears(Heartbeat, _acts, 6.0)
    stage.judge("freeze-ends-by-itself", acts, "does not go on 19 s after the freeze", acts)


SCENES = (
    Scene("emergency stop", STOPPED, stopped),
    Scene("its own number", OWN_NUMBER, own_number),
    Scene("strangers", FOREIGN, foreign),
    Scene("a jump of time", JUMP, jump),
    Scene("a freeze", FREEZE, freeze, needs_other=True),
)

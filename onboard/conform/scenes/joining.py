"""Power-up, signs of life, questions and answers: chapters 2, 3 and 12 of docs/protocol.md."""

from itertools import pairwise

from onboard.conform.cast import Cast, Part
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import MS, OPERATOR, SECOND, Play, Stage, Word
from onboard.contract.codes import Grade, LegAction, MachineState, Reason
from onboard.contract.constants import ACTING
from onboard.contract.messages import Halted, Heartbeat, Itinerary, Progress, SyncDone, SyncRequest

_PAST = (
    "A first life in a fleet that has a past (a `boot` above 1) waits for all machines of the site, also those that "
    "are away; meanwhile it says `Halted` JOURNAL_LOST, naming whom it waits for."
)

FIRST = (
    Check("no-plan-before-time", "T2", "A robot tells neither place nor plan before the first"),
    Check("first-word-is-a-heartbeat", "J1", "My first word is a `Heartbeat` with state STARTING"),
    Check("asks-all-at-once", "R1", "then `SyncRequest` to all (0)."),
    Check(
        "tells-its-place",
        "J5",
        (
            "A robot tells, as soon as it knows its place and before it says any other "
            "state than STARTING: `Progress`, and a FIRM itinerary."
        ),
    ),
    Check(
        "plan-before-another-state",
        "J5",
        (
            "A robot tells, as soon as it knows its place and before it says any other "
            "state than STARTING: `Progress`, and a FIRM itinerary."
        ),
    ),
    Check("stands-by-one-leg", "J5", ("One that only stands tells one leg STAND from its segment to its segment")),
    Check("stands-under-own-stamp", "J5", "under a stamp of bus time now, its own node-ID and call 0"),
    Check("stand-ends-after-1-ms", "J5", "ending 1 ms after that."),
    Check("first-life-names-whom-it-waits-for", "R8", _PAST),
    Check("takes-part-in-the-end", "J9", "its next heartbeat says that it takes part."),
)


def first(stage: Stage, cast: Cast) -> Play:
    """Off and on, on a bus without time, on which all but one answer; then time comes, and the last of all."""
    away = cast.parts.get(stage.other) if stage.means.power else None
    if away is not None:
        away.is_there = False
    cast.gives_time = False
    if stage.means.power:
        stage.switch(on=False)
        yield from stage.pause(1.0)
        stage.switch(on=True)
    begin_us = stage.now_us
    cast.begin()
    yield from stage.pause(3.0)
    known_us = stage.now_us
    is_fresh = stage.means.power or not stage.said_since(begin_us)
    if is_fresh:
        early = [*stage.since(Progress, begin_us), *stage.since(Itinerary, begin_us)]
        stage.none_of("no-plan-before-time", early, "told its place or plan before it knew the time")
    cast.gives_time, cast.time_due_us = True, stage.now_us
    beat = yield from stage.hears(Heartbeat, within_s=10.0, since_us=begin_us)
    if is_fresh and beat is not None:
        first_word = stage.said_since(begin_us)[0]
        starts = isinstance(first_word.message, Heartbeat) and first_word.message.state is MachineState.STARTING
        stage.judge("first-word-is-a-heartbeat", starts, "its first word was another", first_word)
        asks = yield from stage.hears(SyncRequest, lambda one: one.whom == 0, 1.0, begin_us)
        stage.judge("asks-all-at-once", asks, "no SyncRequest to all within 1 s", beat, asks)
        yield from _place(stage, known_us)
        if away is not None and beat.message.boot == 1:
            yield from _waits(stage, away, known_us)
    if away is not None:
        away.is_there = True
        cast.beat(away)
    acts = yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 10.0)
    stage.judge("takes-part-in-the-end", acts, "says no state of one who takes part", beat, acts)


def _waits(stage: Stage, away: Part, since_us: int) -> Play:
    """It has no journal, the others lived before, and one of them is not there."""
    yield from stage.pause(8.0)
    told = [one for one in stage.since(Halted, since_us) if one.message.machine == stage.node]
    reasons = {(one.message.reason, one.message.cause) for one in told}
    is_so = (Reason.JOURNAL_LOST, away.node) in reasons
    stage.judge("first-life-names-whom-it-waits-for", is_so, f"{sorted(reasons)}", *told)


def _is_every(words: list[Word], apart_us: int, late_us: int) -> bool:
    gaps = [b.time_us - a.time_us for a, b in pairwise(words)]
    return len(gaps) >= 2 and all(apart_us - late_us <= gap <= apart_us + 4 * late_us for gap in gaps)


def _place(stage: Stage, since_us: int) -> Play:
    place = yield from stage.hears(Progress, within_s=5.0, since_us=since_us)
    stage.judge("tells-its-place", place, "no Progress within 5 s", place)
    plan = yield from stage.hears(Itinerary, lambda one: one.grade is Grade.FIRM, 5.0, since_us)
    other = yield from stage.hears(Heartbeat, lambda one: one.state is not MachineState.STARTING, 10.0, since_us)
    is_first = plan is not None and (other is None or plan.time_us <= other.time_us)
    stage.judge("plan-before-another-state", is_first, "another state before its plan", plan, other)
    if plan is None or place is None:
        return
    told: Itinerary = plan.message
    leg = told.legs[0] if told.legs else None
    here = (place.message.track, place.message.index)
    is_stand = leg is not None and len(told.legs) == 1 and leg.action is LegAction.STAND
    is_here = leg is not None and (leg.track, leg.from_index) == here and leg.to_index == leg.from_index
    stage.judge("stands-by-one-leg", is_stand and is_here, "another plan than one STAND leg where it is", place, plan)
    stamp, now_ms = told.stamp, stage.bus_ms(stage.bus_us_at(plan.time_us))
    is_now = abs((now_ms - stamp.award_ms + 2**31) % 2**32 - 2**31) <= 100
    is_own = (stamp.initiator, stamp.call) == (stage.node, 0)
    stage.judge("stands-under-own-stamp", is_now and is_own, f"stamp {stamp}, bus time {now_ms} ms", plan)
    ends = leg is not None and (leg.end_ms - stamp.award_ms) % 2**32 == 1
    stage.judge("stand-ends-after-1-ms", ends, "ends otherwise", plan)


ANSWERS = (
    Check(
        "answers-with-its-plan",
        "R3",
        ("A `SyncRequest` to me or to all is answered with what I vouch for: firm itinerary under its version"),
    ),
    Check(
        "plan-under-its-version",
        "R3",
        ("A `SyncRequest` to me or to all is answered with what I vouch for: firm itinerary under its version"),
    ),
    Check("answers-with-its-place", "R3", "firm itinerary under its version, `Progress`"),
    Check("ends-its-answer", "R3", "then `SyncDone` naming who asked."),
    Check("done-is-the-last", "R3", "then `SyncDone` naming who asked."),
    Check("done-tells-the-life", "R3", "then `SyncDone` naming who asked."),
    Check("answers-who-asks-all", "R3", "A `SyncRequest` to me or to all is answered with what I vouch for"),
    Check("asks-who-asks-all", "R5", "Whoever asks all was started again: it is asked at once"),
    Check("answers-a-tool", "R3", "A `SyncRequest` to me or to all is answered with what I vouch for"),
    Check(
        "shares-an-answer",
        "R3",
        ("Who asks within `T_share` of an answer gets the next one with the others, and that names nobody (0)."),
    ),
    Check("leaves-questions-to-others", "R3", "A `SyncRequest` to me or to all is answered"),
    Check("stranger-gets-no-answer", "F2", "I hear only machines of the site file"),
)


def answers(stage: Stage, cast: Cast) -> Play:
    """It is asked, by one, by all, by a tool, by a stranger, and by two within a moment."""
    begin_us = stage.now_us
    last = stage.last(Itinerary)
    stage.say(SyncRequest(stage.caller, stage.node))
    done = yield from stage.hears(SyncDone, lambda one: one.whom == stage.caller, 2.0)
    plans, places = stage.since(Itinerary, begin_us), stage.since(Progress, begin_us)
    stage.judge("answers-with-its-plan", plans, "no itinerary", done)
    is_same = plans and (last is None or plans[-1].message.version == last.message.version)
    stage.judge("plan-under-its-version", is_same, "another version than before", last, *plans)
    stage.judge("answers-with-its-place", places, "no Progress", done)
    stage.judge("ends-its-answer", done, "no SyncDone naming who asked within 2 s", done)
    if done is not None:
        is_last = all(one.time_us <= done.time_us for one in (*plans, *places))
        stage.judge("done-is-the-last", is_last, "SyncDone before the answer", done, *plans, *places)
        beat = stage.last(Heartbeat)
        stage.judge("done-tells-the-life", beat and beat.message.boot == done.message.boot, "another boot", done, beat)
    yield from stage.pause(1.0)
    for name, sender, whom in (("answers-who-asks-all", stage.caller, 0), ("answers-a-tool", OPERATOR, stage.node)):
        begin_us = stage.now_us
        stage.say(SyncRequest(sender, whom))
        done = yield from stage.hears(SyncDone, within_s=2.0)
        stage.judge(name, done, "no SyncDone within 2 s", done)
        yield from stage.pause(1.0)
        if not whom:
            asks = [one for one in stage.since(SyncRequest, begin_us) if one.message.whom == sender]
            stage.judge("asks-who-asks-all", asks, "asks nothing", done, *asks)
    yield from _shared(stage, cast)
    for name, sender, whom in (
        ("leaves-questions-to-others", stage.caller, stage.other or stage.stranger),
        ("stranger-gets-no-answer", stage.stranger, stage.node),
    ):
        begin_us = stage.now_us
        stage.say(SyncRequest(sender, whom))
        yield from stage.pause(2.0)
        stage.none_of(name, stage.since(SyncDone, begin_us), "it answered")


def _shared(stage: Stage, _: Cast) -> Play:
    stage.say(SyncRequest(stage.caller, stage.node))
    one = yield from stage.hears(SyncDone, within_s=2.0)
    if one is None:
        return
    stage.say(SyncRequest(stage.caller, stage.node))
    yield from stage.pause(0.05)
    stage.say(SyncRequest(OPERATOR, stage.node))
    yield from stage.pause(1.5)
    later = stage.since(SyncDone, one.time_us + 1)
    stage.judge("shares-an-answer", [w.message.whom for w in later] == [0], "not one answer to nobody", one, *later)


DIGESTS = (
    Check(
        "asks-about-another-digest",
        "R6",
        (
            "Whoever hears a digest that is not its own, nor was within `T_mine`, asks its "
            "sender after `T_wait` and its turn"
        ),
    ),
    Check("asks-not-at-once", "R6", "asks its sender after `T_wait` and its turn"),
    Check("asks-three-times", "R6", "at the first three heartbeats that tell so"),
    Check("then-asks-every-eighth", "R6", "then at every eighth."),
    Check("equal-digest-is-not-asked", "R6", "Whoever hears a digest that is not its own"),
    Check(
        "asks-who-lives-anew",
        "R5",
        ("A machine that I hear for the first time in its life is asked: at once where I knew an earlier life of it"),
    ),
    Check("names-the-earlier-life", "R5", ("at once where I knew an earlier life of it, and `boot_before` says so")),
)


def digests(stage: Stage, cast: Cast) -> Play:
    """A machine tells a digest that nobody else has; then it lives anew."""
    part = cast.parts[stage.other]
    yield from stage.pause(5.0)
    begin_us = stage.now_us - 5 * SECOND
    stage.none_of("equal-digest-is-not-asked", _asked(stage, begin_us), "asks though all tell the same")
    begin_us = stage.now_us
    part.digest_error = 0x1234
    said_us = part.due_us
    asks = yield from stage.hears(SyncRequest, lambda one: one.whom == stage.other, 4.0)
    stage.judge("asks-about-another-digest", asks, "no SyncRequest within 4 s", asks)
    if asks is not None:
        stage.judge("asks-not-at-once", asks.time_us - said_us >= 20 * MS, "sooner than T_wait", asks)
    yield from stage.pause(13.0)
    many = _asked(stage, begin_us)
    stage.judge("asks-three-times", len(many) == 3, f"{len(many)} times at seven heartbeats", *many)
    yield from stage.pause(14.0)
    more = _asked(stage, begin_us)
    stage.judge("then-asks-every-eighth", len(more) in (4, 5), f"{len(more)} times at 14 heartbeats", *more)
    part.digest_error = 0
    yield from stage.pause(5.0)
    begin_us, before = stage.now_us, part.boot
    part.lives_anew()
    part.state = MachineState.STARTING
    cast.beat(part)
    asks = yield from stage.hears(SyncRequest, lambda one: one.whom == stage.other, 2.0)
    is_prompt = asks is not None and asks.time_us - begin_us <= 300 * MS
    stage.judge("asks-who-lives-anew", is_prompt, "not asked within 0.3 s", asks)
    stage.judge("names-the-earlier-life", asks and asks.message.boot_before == before, "another life", asks)
    yield from stage.pause(3.0)


def _asked(stage: Stage, begin_us: int) -> list[Word]:
    return [one for one in stage.since(SyncRequest, begin_us) if one.message.whom == stage.other]


SILENCES = (
    Check(
        "tells-of-the-silent",
        "H6",
        ("The lowest live node that is no obstacle says `Halted` of each machine that is silent"),
    ),
    Check("tells-once-a-beat", "H6", "once in `T_beat`"),
    Check("tells-why-it-is-silent", "H6", "with that machine's own last reason, or NODE_SILENT"),
    Check(
        "tells-not-before-T-silent", "J6", ("I take another machine for an obstacle that is not heard for `T_silent`")
    ),
    Check("leaves-it-to-the-lowest", "H6", "The lowest live node that is no obstacle says `Halted`"),
    Check("beats-without-company", "J2", "I say `Heartbeat` every `T_beat`"),
)


def silences(stage: Stage, cast: Cast) -> Play:
    """All below the node fall silent; then one above it while the lowest lives."""
    begin_us = stage.now_us
    for part in cast.parts.values():
        part.is_there = part.node > stage.node
    word = yield from stage.hears(Halted, lambda one: one.machine == stage.caller, 12.0)
    stage.judge("tells-of-the-silent", word, "no Halted of who is silent within 12 s", word)
    if word is not None:
        silent_us = 3 * stage.site.timing.heartbeat_us
        stage.judge("tells-not-before-T-silent", word.time_us - begin_us >= silent_us - 2 * SECOND, "too soon", word)
        stage.judge("tells-why-it-is-silent", word.message.reason is Reason.NODE_SILENT, "another reason", word)
        yield from stage.pause(6.0)
        told = [one for one in stage.since(Halted, word.time_us) if one.message.machine == stage.caller]
        stage.judge("tells-once-a-beat", len(told) in (3, 4), f"{len(told)} times in 6 s", *told)
    beats = stage.since(Heartbeat, stage.now_us - 6 * SECOND)
    stage.judge("beats-without-company", len(beats) in (3, 4), f"{len(beats)} heartbeats in 6 s", *beats)
    for part in cast.parts.values():
        part.is_there = True
    yield from stage.pause(5.0)
    if stage.other > stage.node:
        begin_us = stage.now_us
        cast.parts[stage.other].is_there = False
        yield from stage.pause(12.0)
        stage.none_of("leaves-it-to-the-lowest", stage.since(Halted, begin_us), "tells though a lower node lives")
        cast.parts[stage.other].is_there = True
        yield from stage.pause(4.0)


LIFE = (
    Check("a-new-life-has-a-new-boot", "J1", "`boot` is kept in the journal and grows with each life"),
    Check("asks-all-in-each-life", "R1", "then `SyncRequest` to all (0)."),
    Check("starts-in-each-life", "J1", "then I do as after a restart"),
    Check("asks-again-who-is-silent", "R2", "It asks who has not answered every `T_again`."),
    Check("asks-nobody-who-answered", "R2", "It asks who has not answered every `T_again`."),
    Check("an-answer-to-others-is-none", "R2", "A `SyncDone` that names nobody answers me where its `askers`"),
)


def another_life(stage: Stage, cast: Cast) -> Play:
    """Off and on while the fleet lives; one machine of it does not answer at first."""
    slow = cast.parts.get(stage.other)
    last = stage.last(Heartbeat)
    stage.switch(on=False)
    yield from stage.pause(1.0)
    begin_us = stage.now_us
    if slow is not None:
        slow.answers = False
    stage.switch(on=True)
    beat = yield from stage.hears(Heartbeat, within_s=12.0)
    if beat is not None and last is not None:
        grown = beat.message.boot == last.message.boot % 255 + 1
        stage.judge("a-new-life-has-a-new-boot", grown, "not one more", last, beat)
        stage.judge("starts-in-each-life", beat.message.state is MachineState.STARTING, "another state", beat)
    asks = yield from stage.hears(SyncRequest, lambda one: one.whom == 0, 2.0, begin_us)
    stage.judge("asks-all-in-each-life", asks, "asks nobody", asks)
    yield from stage.pause(2.5)
    if slow is not None:
        # Its answer was begun before the node was there.
        stage.say(SyncDone(slow.node, 0, slow.boot, 1 << sorted(stage.site.machines).index(stage.caller)))
    yield from stage.pause(3.5)
    if slow is not None:
        again = [one for one in stage.since(SyncRequest, stage.now_us - 3 * SECOND) if one.message.whom == slow.node]
        is_kept = _is_every(again, 500 * MS, stage.means.late_us)
        stage.judge("asks-again-who-is-silent", is_kept, "not every 0.5 s", *again)
        stage.judge("an-answer-to-others-is-none", again, "asks no more", asks, *again)
        others = [one for one in stage.since(SyncRequest, begin_us + 4 * SECOND) if one.message.whom == stage.caller]
        stage.none_of("asks-nobody-who-answered", others, "asks who has answered")
        slow.answers = True
    yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 15.0)
    yield from stage.pause(4.0)


SCENES = (
    Scene("joining", FIRST, first),
    Scene("questions", ANSWERS, answers),
    Scene("digests", DIGESTS, digests, needs_other=True),
    Scene("silence", SILENCES, silences),
    Scene("another life", LIFE, another_life, needs_power=True),
)

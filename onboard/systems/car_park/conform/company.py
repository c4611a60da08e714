"""Another robot that goes first, or comes behind: chapters 7 and 8 of docs/protocol.md, the order of passing."""

from collections.abc import Generator

from onboard.conform.cast import Cast, grants
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import Play, Stage, Wait, Word, after_ms
from onboard.contract.codes import Grade, LegAction, MachineState, Reason, TaskPhase, TokenKind
from onboard.contract.messages import (
    CallForProposals,
    Heartbeat,
    Itinerary,
    Progress,
    Stamp,
    SyncRequest,
    TaskReport,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    Waiting,
)
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.conform.rival import Rival, meeting, windows

_AROUND = "I plan around what all others have told: no window of mine overlaps one of theirs by more than `T_round`."
_BEFORE = "`predecessor` who passes right before me by the plans that I know, 0 for nobody."
_STAYS = (
    "Where two plans had agreed who passes a segment first, that order stays whatever is late: who comes behind tells "
    "its plan later by what is missing."
)
_ORDER = "A segment goes in the order of passing"
_KNOWS_NO_PLAN = (
    "A holder refuses with MIRROR_BEHIND where it knows no plan of the requester, or none as new as `itinerary_version`"
)
_OTHER_ORDER = "where, of the same version, it sees another `predecessor` than the request names."
_NEEDS = (
    "What its body is in, and what it needs on its own way, a robot refuses with that reason whatever the request "
    "names."
)
_ASKS = (
    "With MIRROR_BEHIND it asks those whom it is about for their plans (`SyncRequest`, each at most every `T_view`)."
)

BEHIND = (
    Check("bid-comes-behind-another-plan", "P6", _AROUND),
    Check("plan-leaves-anothers-windows", "P6", _AROUND),
    Check("plan-keeps-its-bid-behind-another", "B2", "What it promises it keeps as well as it can"),
    Check("request-names-who-passes-before", "K9", _BEFORE),
    Check("request-names-nobody-elsewhere", "K9", _BEFORE),
    Check("waits-behind-another", "K2", "I move, or let move, only within segments whose tokens I hold"),
    Check("waiting-names-whom-it-waits-for", "P11", "`Waiting` is said once for each wait for a refused segment."),
    Check("waiting-robot-says-so", "P11", "`Waiting` is said once for each wait for a refused segment."),
    Check("later-other-makes-it-later", "P8", _STAYS),
    Check("later-plan-keeps-its-stamp", "P7", "The other makes its plan anew and tells it, under its old stamp"),
    Check("later-plan-leaves-anothers-windows", "P6", _AROUND),
    Check("goes-on-behind-another", "K12", "Else it grants where it sees nobody before the requester"),
    Check("tells-anew-what-is-late", "P9", "A robot whose step is, or will be, 2 s late tells its plan anew"),
)


def behind(stage: Stage, cast: Cast) -> Play:
    """Another robot has planned to stand before the bay; it is late, and goes at last."""
    desk = Desk(stage, cast, 0x1000, 1_500)
    desk.place_car()
    rival, bay = Rival(stage, cast, desk), desk.bay.segment
    before = _segments(desk, rival.home.track, bay.index)
    rival.way((bay.index, 30.0)).into(rival.home.track)
    rival.tell(Stamp(stage.bus_ms(), stage.caller, 0xF0))
    rival.takes(*before)
    yield from stage.pause(0.4)
    call, bid = yield from desk.wins()
    if bid is None:
        desk.withdraw(call)
        rival.stands()
        return
    awarded_us = stage.now_us
    leaves_ms = max(one.to_ms for one in windows(desk, rival.plan) if one.segment == bay)
    least_ms = leaves_ms - stage.unrolled_ms(call.deadline_ms) + desk.handling_us(desk.bay) // 1000
    is_behind = desk.over_ms(call, bid) >= least_ms
    stage.judge("bid-comes-behind-another-plan", is_behind, f"not {least_ms} ms behind the deadline", bid)
    plan = yield from stage.hears(Itinerary, lambda one: one.grade is Grade.FIRM, 3.0, awarded_us)
    if plan is None:
        rival.stands()
        return
    meets = meeting(desk, plan.message, rival.plan)
    stage.judge("plan-leaves-anothers-windows", meets is None, f"{meets}", plan)
    ends = [leg.end_ms for leg in plan.message.legs if leg.action is LegAction.WORK]
    off_ms = after_ms(ends[-1], bid.message.cost) if ends else 1 << 31
    stage.judge("plan-keeps-its-bid-behind-another", abs(off_ms) <= 1_000, f"{off_ms} ms later", bid, plan)
    yield from _waits(stage, cast, desk, rival, before, plan)
    yield from _goes(stage, cast, desk, rival, before, call, awarded_us)


def _segments(desk: Desk, spur: int, index: int) -> list[Segment]:
    """From a spur's mouth along the alley to an index."""
    mouth = desk.segment_at(spur, 0)
    step = 1 if index >= mouth.index else -1
    return [Segment(mouth.track, one) for one in range(mouth.index, index + step, step)]


def _waits(stage: Stage, cast: Cast, desk: Desk, rival: Rival, before: list[Segment], plan: Word) -> Play:
    begin_us, stamp = plan.time_us, rival.plan.stamp
    mine = {one.number for one in before}
    cast.answer = lambda key, _: Reason.TOKEN_NOT_GRANTABLE_YET if key.number in mine else Reason.NONE
    yield from rival.drives(5.0)
    last = next(one for one in reversed(stage.words[Itinerary]) if one.message.grade is Grade.FIRM)
    later_us = stage.now_us
    rival.way((desk.bay.index, 45.0)).into(rival.home.track).tell(stamp)
    anew = yield from stage.hears(Itinerary, lambda one: one.grade is Grade.FIRM, 3.0, later_us)
    by_ms = _work_ms(stage, anew.message) - _work_ms(stage, last.message) if anew is not None else 0
    stage.judge("later-other-makes-it-later", by_ms >= 5_000, f"later by {by_ms} ms, the other by 15 s", last, anew)
    if anew is not None:
        is_same = anew.message.stamp[1:] == last.message.stamp[1:]
        stage.judge("later-plan-keeps-its-stamp", is_same, "another stamp", last, anew)
        work_ms = max(one.to_ms for one in windows(desk, rival.plan) if one.segment == desk.bay.segment)
        is_behind = _work_ms(stage, anew.message) - desk.handling_us(desk.bay) // 1000 >= work_ms - 100
        stage.judge("later-plan-leaves-anothers-windows", is_behind, "works before the other has left", anew)
    lasts_s = (rival.plan.legs[-1].end_ms - stage.bus_ms()) % 2**32 / 1000
    yield from rival.drives(lasts_s + 8.0)
    asked = [one for one in stage.since(TokenRequest, begin_us) if _is_slot(one)]
    first = next((one for one in asked if one.message.token in mine), None)
    names = first is not None and first.message.predecessor == stage.rival
    stage.judge("request-names-who-passes-before", names, f"not {stage.rival}", plan, first)
    wrong = [one for one in asked if one.message.predecessor and one.message.token in _alone(desk, rival)]
    stage.judge("request-names-nobody-elsewhere", not wrong, "names somebody", *wrong)
    waits = [one for one in stage.since(Waiting, begin_us) if one.message.track << 8 | one.message.index in mine]
    stage.judge("waiting-robot-says-so", waits, "no Waiting", first)
    is_named = waits and waits[0].message.blocker == stage.rival
    stage.judge("waiting-names-whom-it-waits-for", is_named, f"not {stage.rival}", *waits)


def _alone(desk: Desk, rival: Rival) -> set[int]:
    passed = {one.segment.number for one in windows(desk, rival.plan)}
    return {Segment(desk.bay.track, index).number for index in range(1, 128)} - passed


def _is_slot(word: Word) -> bool:
    return bool(word.message.token_kind is TokenKind.SEGMENT)


def _work_ms(stage: Stage, plan: Itinerary) -> int:
    return next((stage.unrolled_ms(leg.end_ms) for leg in plan.legs if leg.action is LegAction.WORK), 0)


def _goes(
    stage: Stage, cast: Cast, desk: Desk, rival: Rival, before: list[Segment], call: CallForProposals, awarded_us: int
) -> Play:
    """The other keeps its rights far longer than it planned: the node never goes before it."""
    begin_us = stage.now_us
    yield from rival.drives(10.0)
    early = [one for one in stage.since(TaskReport, awarded_us) if one.message.phase is TaskPhase.STARTED]
    stage.none_of("waits-behind-another", early, "is before the bay")
    rival.stands()
    rival.gives_back(*before)
    cast.answer = grants
    started = yield from _report(stage, call, TaskPhase.STARTED, 60.0, begin_us)
    stage.judge("goes-on-behind-another", started, "no STARTED within 60 s", started)
    plans = [one for one in stage.since(Itinerary, begin_us) if one.message.grade is Grade.FIRM]
    stage.judge("tells-anew-what-is-late", plans, "no new plan though it waits long", started)
    desk.withdraw(call)
    yield from stage.pause(45.0)


def _report(
    stage: Stage, call: CallForProposals, phase: TaskPhase, within_s: float, since_us: int
) -> Generator[Wait, None, Word | None]:
    return (
        yield from stage.hears(TaskReport, lambda one: one.task == call.task and one.phase is phase, within_s, since_us)
    )


AHEAD = (
    Check("who-is-behind-waits", "K12", _NEEDS),
    Check("known-plan-is-not-asked-for", "K12", _ASKS),
    Check("grants-whose-turn-it-is", "K10", "A holder looks at open requests again by itself"),
    Check("grants-not-before-it-has-left", "K14", "A robot gives back to its steward what its body has left"),
    Check("gives-what-it-left-to-who-asks", "K14", "Who asks for one of those gets it from the robot, by [K12]"),
    Check("lapsed-request-is-forgotten", "K10", "Every machine remembers every request for `T_lapse`"),
    Check("silent-requester-gets-nothing", "K10", "It grants none to who was not heard for 1.25 `T_beat`."),
    Check("who-comes-behind-waits-too", "K12", _NEEDS),
    Check("unknown-plan-is-refused", "K12", _KNOWS_NO_PLAN),
    Check("unknown-plan-is-asked-for", "K12", _ASKS),
    Check("another-order-is-refused", "K12", _OTHER_ORDER),
    Check("another-order-is-asked-about", "K12", _ASKS),
    Check("gives-in-the-order-that-both-see", "K12", "Else it grants where it sees nobody before the requester"),
    Check("asks-about-an-order-at-most-so-often", "K12", _ASKS),
)
#: Where it is held up: so many segments before the bay.
_BEFORE_BAY = 4


def ahead(stage: Stage, cast: Cast) -> Play:
    """The node is held up on its way to the bay, and another robot asks for the segment that it is in."""
    desk = Desk(stage, cast, 0x1100, 1_600)
    desk.place_car()
    rival = Rival(stage, cast, desk)
    for play in (_turn, _views, _left, _lapse, _silence):
        call = yield from _held_up(stage, cast, desk, rival)
        if call is not None:
            yield from play(stage, cast, desk, rival)
            desk.withdraw(call)
        rival.stands()
        rival.gives_back(*(Segment(desk.bay.track, one) for one in range(1, desk.site.tracks[desk.bay.track].length)))
        cast.answer = grants
        yield from stage.pause(10.0)
        yield from stage.hears(Heartbeat, lambda one: one.state is MachineState.IDLE, 90.0)
        yield from stage.pause(15.0)


def _held_up(stage: Stage, cast: Cast, desk: Desk, rival: Rival) -> Generator[Wait, None, CallForProposals | None]:
    """On the way to the bay, all behind which is refused; the other plans to come behind it."""
    place = stage.last(Progress)
    if place is None:
        return None
    start = desk.segment_at(place.message.track, 0 if place.message.track != desk.bay.track else place.message.index)
    side = 1 if start.index > desk.bay.index else -1
    stop = Segment(
        desk.bay.track,
        desk.bay.index + side * (_BEFORE_BAY if side * (start.index - desk.bay.index) > _BEFORE_BAY else 1),
    )
    beyond = {Segment(stop.track, stop.index - side * step).number for step in range(1, 12)}
    cast.answer = lambda key, _: (
        Reason.TOKEN_NOT_GRANTABLE_YET if key.kind is not TokenKind.SEGMENT or key.number in beyond else Reason.NONE
    )
    call, bid = yield from desk.wins()
    if bid is None:
        return None
    begin_us = stage.now_us
    here = yield from stage.hears(
        Progress, lambda one: (one.track, one.index, one.speed_mm_s) == (stop.track, stop.index, 0), 60.0, begin_us
    )
    if here is None:
        desk.withdraw(call)
        return None
    rival.way((stop.index, 2.0), first_s=25.0).into(rival.home.track).tell()
    yield from stage.pause(0.5)
    return call


def _stop(stage: Stage) -> Segment:
    place = stage.last(Progress)
    assert place is not None
    return Segment(place.message.track, place.message.index)


def _refused(stage: Stage, since_us: int) -> Generator[Wait, None, Word | None]:
    return (yield from stage.hears(TokenRefusal, lambda one: one.requester == stage.rival, 1.0, since_us))


def _asked(stage: Stage, since_us: int) -> list[Word]:
    return [one for one in stage.since(SyncRequest, since_us) if one.message.whom == stage.rival]


def _given(stage: Stage, segment: Segment, since_us: int, within_s: float) -> Generator[Wait, None, Word | None]:
    key = (TokenKind.SEGMENT, segment.number)
    return (yield from stage.hears(TokenGrant, lambda one: (one.token_kind, one.token) == key, within_s, since_us))


def _turn(stage: Stage, cast: Cast, desk: Desk, rival: Rival) -> Play:
    """Its request is remembered: it gets the segment as the node leaves it, and what was left behind when it asks."""
    here, begin_us = _stop(stage), stage.now_us
    rival.asks(here, stage.node)
    word = yield from _refused(stage, begin_us)
    is_so = word is not None and word.message.reason is Reason.TOKEN_NOT_GRANTABLE_YET
    stage.judge("who-is-behind-waits", is_so, "not refused as not grantable yet", word)
    yield from stage.pause(2.5)
    stage.none_of("known-plan-is-not-asked-for", _asked(stage, begin_us), "asks for a plan that it knows")
    cast.answer = lambda key, _: Reason.NONE if key.kind is TokenKind.SEGMENT else Reason.DOOR_NOT_READY
    word = yield from _given(stage, here, begin_us, 20.0)
    is_its = word is not None and word.message.holder == stage.rival
    stage.judge("grants-whose-turn-it-is", is_its, f"not to node {stage.rival}", word)
    yield from stage.pause(10.0)
    _ = desk


def _views(stage: Stage, cast: Cast, desk: Desk, rival: Rival) -> Play:
    """The two see different orders of passing, then the same."""
    here = _stop(stage)
    cast.answer = lambda key, _: Reason.NONE if key.kind is TokenKind.SEGMENT else Reason.DOOR_NOT_READY
    wanted = Segment(here.track, desk.bay.index + (1 if here.index > desk.bay.index else -1))
    key = (TokenKind.SEGMENT, wanted.number)
    if (yield from stage.hears(TokenHeld, lambda one: (one.token_kind, one.token) == key, 15.0)) is not None:
        yield from _on_the_way(stage, cast, rival, here, wanted)
    yield from stage.pause(10.0)


def _on_the_way(stage: Stage, cast: Cast, rival: Rival, here: Segment, wanted: Segment) -> Play:
    """While it moves on, the other asks for a segment that it has not come to, and for what it has left."""
    begin_us = stage.now_us
    rival.asks(wanted, stage.node)
    word = yield from _refused(stage, begin_us)
    is_so = word is not None and word.message.reason is Reason.TOKEN_NOT_GRANTABLE_YET
    stage.judge("who-comes-behind-waits-too", is_so, "not refused as not grantable yet", word)
    yield from stage.pause(4.3)
    if cast.holder(TokenKey(TokenKind.SEGMENT, here.number))[0] != stage.node:
        return
    begin_us = stage.now_us
    rival.asks(here, stage.node, rival.plan.version % 255 + 1)
    word = yield from _refused(stage, begin_us)
    is_so = word is not None and word.message.reason is Reason.MIRROR_BEHIND
    stage.judge("unknown-plan-is-refused", is_so, "not refused with MIRROR_BEHIND", word)
    yield from stage.pause(0.3)
    stage.judge("unknown-plan-is-asked-for", _asked(stage, begin_us), "asks for no plan", word)
    begin_us = stage.now_us
    rival.asks(here, stage.caller)
    word = yield from _refused(stage, begin_us)
    is_so = word is not None and word.message.reason is Reason.MIRROR_BEHIND
    stage.judge("another-order-is-refused", is_so, "not refused with MIRROR_BEHIND", word)
    for _ in range(5):
        rival.asks(here, stage.caller)
        yield from stage.pause(0.25)
    many = _asked(stage, begin_us)
    stage.judge("another-order-is-asked-about", many, "asks for no plan", word)
    stage.judge("asks-about-an-order-at-most-so-often", len(many) <= 2, f"{len(many)} times in 1.3 s", *many)
    begin_us = stage.now_us
    rival.asks(here, stage.node)
    word = yield from _given(stage, here, begin_us, 2.0)
    is_its = word is not None and word.message.holder == stage.rival
    stage.judge("gives-in-the-order-that-both-see", is_its, f"not to node {stage.rival}", word)


def _lapse(stage: Stage, cast: Cast, desk: Desk, rival: Rival) -> Play:
    """It has asked once, long ago; then it asks for what the node has left a moment ago."""
    here, begin_us = _stop(stage), stage.now_us
    rival.asks(here, stage.node)
    yield from stage.pause(14.0)
    cast.answer = lambda key, _: Reason.NONE if key.kind is TokenKind.SEGMENT else Reason.DOOR_NOT_READY
    yield from stage.hears(Progress, lambda one: one.index != here.index, 10.0)
    yield from stage.pause(3.0)
    early = [one for one in stage.since(TokenGrant, begin_us) if one.message.holder == stage.rival]
    stage.none_of("lapsed-request-is-forgotten", early, "grants it to who asked long ago")
    yield from stage.pause(8.0)
    _ = desk


def _left(stage: Stage, cast: Cast, desk: Desk, rival: Rival) -> Play:
    """It asks again and again: as soon as the node has passed, it gets what that has left."""
    here, begin_us = _stop(stage), stage.now_us
    cast.answer = lambda key, _: Reason.NONE if key.kind is TokenKind.SEGMENT else Reason.DOOR_NOT_READY
    for _ in range(15):
        rival.asks(here, stage.node)
        yield from stage.pause(1.0)
        if cast.holder(TokenKey(TokenKind.SEGMENT, here.number))[0] != stage.node:
            break
    word = yield from _given(stage, here, begin_us, 3.0)
    is_its = word is not None and word.message.holder == stage.rival
    stage.judge("gives-what-it-left-to-who-asks", is_its, f"not to node {stage.rival}", word)
    place = stage.last(Progress)
    is_left = word is not None and place is not None and place.message.index != here.index
    stage.judge("grants-not-before-it-has-left", is_left, "its last place is there still", place, word)
    yield from stage.pause(8.0)
    _ = desk


def _silence(stage: Stage, cast: Cast, desk: Desk, rival: Rival) -> Play:
    """It asks, and falls silent."""
    here, begin_us = _stop(stage), stage.now_us
    rival.asks(here, stage.node)
    part = cast.parts[rival.node]
    part.is_there = part.answers = False
    yield from stage.pause(3.5)
    cast.answer = lambda key, _: Reason.NONE if key.kind is TokenKind.SEGMENT else Reason.DOOR_NOT_READY
    yield from stage.pause(12.0)
    early = [one for one in stage.since(TokenGrant, begin_us) if one.message.holder == stage.rival]
    stage.none_of("silent-requester-gets-nothing", early, "grants it to who is silent")
    part.is_there = part.answers = True
    yield from stage.pause(3.0)
    _ = desk


SCENES = (
    Scene("another robot goes first", BEHIND, behind, needs_car=True, needs_rival=True),
    Scene("another robot comes behind", AHEAD, ahead, needs_car=True, needs_rival=True),
)

"""Power cuts and stops while a car is parked: chapters 12 and 13 of docs/protocol.md, with something in hand."""

from collections.abc import Generator

from onboard.conform.cast import Cast, grants
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import OPERATOR, SECOND, Play, Stage, Wait, Word
from onboard.contract.codes import LegAction, MachineState, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ACTING, ANY_STATION
from onboard.contract.messages import (
    CallForProposals,
    CarAt,
    EmergencyStop,
    Go,
    Heartbeat,
    Itinerary,
    Progress,
    SyncRequest,
    TaskReport,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRequest,
)
from onboard.core.token_keys import TokenKey, genesis_holder
from onboard.systems.car_park.conform.desk import Desk

_TELLS = (
    "Whoever is started says from it `TokenHeld` for each token that it holds away from its first holder, "
    "`TokenGiven` for each grant under way, then `SyncRequest` to all (0)."
)
_WAITS = (
    "It uses no right, gives none away and, where its journal knows an earlier life, touches neither plan nor drive, "
    "before each machine that lives, and has not said `Halted`, has answered with `SyncDone`"
)
_VOUCHES = (
    "firm itinerary under its version, `Progress`, `TaskReport` AWARDED of tasks in hand, `CarAt` of cars in custody"
)
_RISES = "A grant that is under way by the journal is said again only after the sync is over"
_PLACE = "A robot's place comes from its sensors, what is in hand from the journal."
_HAS = "An award for me that is heard again is answered with how the task stands"

#: Moments at which the power is cut, and what they are called in checks.
_MOMENTS = ("on-the-way", "before-the-bay", "at-the-bay", "with-the-car", "at-the-place", "after-it")


def _of_moment(name: str) -> tuple[Check, ...]:
    return (
        Check(f"cut-{name}-tells-what-it-holds", "R1", _TELLS),
        Check(f"cut-{name}-holds-no-more", "R9", "one that was confirmed does not rise again."),
        Check(f"cut-{name}-tells-before-it-asks", "R1", _TELLS),
        Check(f"cut-{name}-waits-for-all", "R2", _WAITS),
        Check(f"cut-{name}-has-its-place", "R10", _PLACE),
        Check(f"cut-{name}-comes-back", "J9", "its next heartbeat says that it takes part."),
        Check(f"cut-{name}-knows-its-task", "U3", _HAS),
    )


CUTS = (
    *(check for name in _MOMENTS for check in _of_moment(name)),
    Check("cut-tells-its-task", "R3", _VOUCHES),
    Check("cut-tells-its-car", "R3", _VOUCHES),
    Check("cut-tells-its-grants", "R1", _TELLS),
    Check("cut-says-them-again-after-the-sync", "R9", _RISES),
    Check("cut-goes-on-to-the-bay", "U2", "A robot says `TaskReport` STARTED"),
    Check("cut-takes-the-car", "R10", _PLACE),
    Check("cut-leaves-the-car", "R10", _PLACE),
    Check("cut-ends-the-task", "U2", "DONE with the station where the car is left when the shuttle is home."),
    Check("cut-plans-its-task", "R3", _VOUCHES),
)


def cuts(stage: Stage, cast: Cast) -> Play:
    """It parks the car, and its power is cut again and again."""
    desk = Desk(stage, cast, 0x0E00, 1_300)
    at = cast.cars.get(desk.car)
    if at is None or at.station != desk.bay.number:
        return
    bays = {TokenKind.STATION, TokenKind.CAR}
    cast.answer = lambda key, _: Reason.DOOR_NOT_READY if key.kind in bays else Reason.NONE
    call, bid = yield from desk.wins()
    if bid is None:
        return
    begin_us = stage.now_us
    moved = yield from stage.hears(Progress, lambda one: one.speed_mm_s != 0, 20.0)
    if moved is None:
        desk.withdraw(call)
        return
    yield from stage.pause(2.5)
    yield from _cut(stage, cast, desk, call, "on-the-way", TaskPhase.AWARDED)
    yield from _asked(stage, desk, call)
    started = yield from _report(stage, call, TaskPhase.STARTED, 60.0, begin_us)
    stage.judge("cut-goes-on-to-the-bay", started, "no STARTED within 60 s", started)
    yield from stage.pause(3.0)
    yield from _cut(stage, cast, desk, call, "before-the-bay", TaskPhase.AWARDED)
    yield from stage.pause(3.0)
    begin_us = stage.now_us
    cast.answer = grants
    took = yield from stage.hears(TokenHeld, lambda one: one.token_kind is TokenKind.CAR, 20.0)
    if took is not None:
        yield from stage.pause(5.0)
        yield from _cut(stage, cast, desk, call, "at-the-bay", TaskPhase.AWARDED)
    aboard = yield from stage.hears(CarAt, _is_aboard, 60.0, begin_us)
    stage.judge("cut-takes-the-car", aboard, "no CarAt aboard within 60 s", aboard)
    if aboard is None:
        return
    yield from _left(stage, cast, desk, call, aboard)


def _is_aboard(one: CarAt) -> bool:
    return one.station == ANY_STATION


def _left(stage: Stage, cast: Cast, desk: Desk, call: CallForProposals, aboard: Word) -> Play:
    yield from _report(stage, call, TaskPhase.LOADED, 10.0, aboard.time_us)
    yield from stage.pause(3.0)
    yield from _cut(stage, cast, desk, call, "with-the-car", TaskPhase.LOADED)
    begin_us = stage.now_us
    stage.say(SyncRequest(stage.caller, stage.node))
    told = yield from stage.hears(CarAt, _is_aboard, 3.0)
    stage.judge("cut-tells-its-car", told, "no CarAt aboard within 3 s", told)
    held = yield from stage.hears(TokenHeld, lambda one: one.token_kind is TokenKind.STATION, 60.0, begin_us)
    yield from stage.pause(2.5)
    # From here on nobody confirms what it gives.
    cast.confirms = False
    if held is not None:
        yield from _cut(stage, cast, desk, call, "at-the-place", TaskPhase.LOADED, TaskPhase.DONE)
    left = yield from stage.hears(CarAt, lambda one: not _is_aboard(one), 60.0, begin_us)
    places = {place.number for place in desk.site.places}
    stage.judge("cut-leaves-the-car", left and left.message.station in places, "no CarAt at a place within 60 s", left)
    done = yield from _report(stage, call, TaskPhase.DONE, 60.0, begin_us)
    stage.judge("cut-ends-the-task", done, "no DONE within 60 s", done)
    yield from stage.pause(1.0)
    yield from _cut(stage, cast, desk, call, "after-it", TaskPhase.DONE, gives=True)
    cast.confirms = True
    yield from stage.pause(20.0)


def _cut(
    stage: Stage, cast: Cast, desk: Desk, call: CallForProposals, name: str, *phases: TaskPhase, gives: bool = False
) -> Play:
    """Off and on; one machine answers late, and until then nothing may be touched."""
    stage.switch(on=False)
    yield from stage.pause(1.0)
    slow = cast.parts.get(stage.other)
    if slow is not None:
        slow.answers = False
    held, under_way = _held(stage, cast), _given(stage, cast)
    begin_us = stage.now_us
    stage.switch(on=True)
    asks = yield from stage.hears(SyncRequest, lambda one: one.whom == 0, 5.0, begin_us)
    asks_us = stage.now_us if asks is None else asks.time_us
    told = {_key(one): one.message.version for one in stage.since(TokenHeld, begin_us) if one.time_us <= asks_us}
    lacks = {key: version for key, version in held.items() if told.get(key) != version}
    stage.judge(f"cut-{name}-tells-what-it-holds", not lacks, f"does not tell {sorted(lacks)}", asks)
    more = sorted(set(told) - set(under_way) - set(cast.held_by(stage.node)))
    stage.judge(f"cut-{name}-holds-no-more", not more, f"holds {more}", *stage.since(TokenHeld, begin_us))
    stage.judge(f"cut-{name}-tells-before-it-asks", asks and not lacks, "asks before it has told all", asks)
    if gives:
        given = {_key(one) for one in stage.since(TokenGiven, begin_us)}
        stage.judge("cut-tells-its-grants", under_way and set(under_way) <= given, f"does not tell {under_way}", asks)
    yield from stage.pause(4.0)
    _judge_waits(stage, name, begin_us)
    if slow is not None:
        slow.answers = True
    if gives:
        yield from _gives_again(stage, under_way)
    acts = yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 15.0, begin_us)
    stage.judge(f"cut-{name}-comes-back", acts, "takes no part within 15 s", acts)
    yield from stage.pause(0.5)
    place = stage.last(Progress)
    is_its = place is not None and place.time_us >= begin_us
    if place is not None and is_its and not place.message.speed_mm_s:
        is_its = cast.holder(desk.segment_key(place.message.track, place.message.index))[0] == stage.node
    stage.judge(f"cut-{name}-has-its-place", is_its, "tells no place that is its own", place)
    begin_us = stage.now_us
    desk.award(call, stage.node, call=0)
    again = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 2.0, begin_us)
    is_kept = again is not None and again.message.phase in phases
    stage.judge(f"cut-{name}-knows-its-task", is_kept, f"not answered {phases[0].name}", again)


def _judge_waits(stage: Stage, name: str, begin_us: int) -> None:
    if not stage.other:
        return
    acts = [one for one in stage.since(Heartbeat, begin_us) if one.message.state in ACTING]
    plans = [one for one in stage.since(Itinerary, begin_us) if len(one.message.legs) > 1]
    # It brakes by itself where it moved: what it says within three seconds is no motion of its new life.
    moves = [one for one in stage.since(Progress, begin_us + 3 * SECOND) if one.message.speed_mm_s]
    uses = [*stage.since(TokenRequest, begin_us), *stage.since(TokenGrant, begin_us)]
    stage.none_of(f"cut-{name}-waits-for-all", [*acts, *plans, *moves, *uses], "goes on before all have answered")


def _gives_again(stage: Stage, under_way: dict[TokenKey, int]) -> Play:
    """What nobody has confirmed is said again behind the sync, and not before it."""
    begin_us = stage.now_us
    yield from stage.pause(8.0)
    given = {_key(one) for one in stage.since(TokenGrant, begin_us)}
    stage.judge("cut-says-them-again-after-the-sync", set(under_way) <= given, f"not all of {sorted(under_way)}")


def _held(stage: Stage, cast: Cast) -> dict[TokenKey, int]:
    """Tokens that it holds away from their first holders, and their versions."""
    away = (key for key in cast.held_by(stage.node) if genesis_holder(stage.site, key) != stage.node)
    return {key: cast.holder(key)[1] for key in away if key not in cast.flights and key not in _given(stage, cast)}


def _given(stage: Stage, cast: Cast) -> dict[TokenKey, int]:
    """Tokens that it gave away by its own word, and nobody has confirmed."""
    found: dict[TokenKey, int] = {}
    for word in stage.words[TokenGrant]:
        key, version = _key(word), word.message.version
        if cast.holder(key)[0] == stage.node and version > cast.holder(key)[1]:
            found[key] = version
    return found


def _asked(stage: Stage, desk: Desk, call: CallForProposals) -> Play:
    begin_us = stage.now_us
    stage.say(SyncRequest(stage.caller, stage.node))
    report = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 3.0, begin_us)
    is_told = report is not None and report.message.phase is TaskPhase.AWARDED
    stage.judge("cut-tells-its-task", is_told, "no TaskReport AWARDED within 3 s", report)
    plan = stage.last(Itinerary)
    works = plan is not None and any(
        leg.action is LegAction.WORK and (leg.track, leg.to_index) == desk.bay.segment for leg in plan.message.legs
    )
    stage.judge("cut-plans-its-task", works, "no plan with work at the bay", plan)


def _report(
    stage: Stage, call: CallForProposals, phase: TaskPhase, within_s: float, since_us: int
) -> Generator[Wait, None, Word | None]:
    return (
        yield from stage.hears(TaskReport, lambda one: one.task == call.task and one.phase is phase, within_s, since_us)
    )


def _key(word: Word) -> TokenKey:
    return TokenKey(word.message.token_kind, word.message.token)


_STOP = "I order no motion from then on; drives brake by themselves."
_HELD = "It gives no right away and takes no task."

STOPS = (
    Check("stop-on-the-way-stands", "H1", _STOP),
    Check("stop-on-the-way-tells-where", "P10", "`Progress` is said by who moves on tracks where it stops"),
    Check("stop-keeps-its-rights", "H2", _HELD),
    Check("stop-gives-nothing-to-who-asks", "H2", _HELD),
    Check("stop-takes-no-task", "H2", _HELD),
    Check("stop-asks-for-nothing", "J10", "An obstacle moves nothing, bids for nothing and opens no call"),
    Check("stop-over-goes-on", "H1", "until an operator's `Go` names its sender (or 0: all)"),
    Check("stop-at-work-stands", "H1", _STOP),
    Check("stop-at-work-goes-on", "U2", "LOADED when the car is aboard and its shuttle home"),
    Check("stopped-task-is-done", "U2", "DONE with the station where the car is left when the shuttle is home."),
    Check("stop-tells-its-state", "H2", "A held machine says its heartbeat with state OBSTACLE"),
)


def stops(stage: Stage, cast: Cast) -> Play:
    """It fetches a car; a stop comes on the way, and while the shuttle works."""
    desk = Desk(stage, cast, 0x0F00, 1_400)
    at = cast.cars.get(desk.car)
    if at is None or at.station == ANY_STATION:
        return
    call, bid = yield from desk.wins_back(at.station)
    if bid is None:
        return
    begin_us = stage.now_us
    moved = yield from stage.hears(Progress, lambda one: one.speed_mm_s != 0, 40.0)
    if moved is not None:
        yield from _stopped_on_the_way(stage, cast, desk)
    started = yield from _report(stage, call, TaskPhase.STARTED, 60.0, begin_us)
    stage.judge("stop-over-goes-on", started, "no STARTED within 60 s", started)
    took = yield from stage.hears(TokenHeld, lambda one: one.token_kind is TokenKind.CAR, 20.0, begin_us)
    if took is not None:
        yield from stage.pause(4.0)
        stage.say(EmergencyStop(OPERATOR, Reason.OPERATOR))
        stop_us = stage.now_us
        yield from stage.pause(20.0)
        early = stage.since(CarAt, stop_us)
        stage.none_of("stop-at-work-stands", early, "works on")
        stage.say(Go(OPERATOR, 0))
    loaded = yield from _report(stage, call, TaskPhase.LOADED, 60.0, begin_us)
    stage.judge("stop-at-work-goes-on", loaded, "no LOADED within 60 s", loaded)
    done = yield from _report(stage, call, TaskPhase.DONE, 90.0, begin_us)
    stage.judge("stopped-task-is-done", done, "no DONE within 90 s", done)
    yield from stage.pause(25.0)


def _stopped_on_the_way(stage: Stage, cast: Cast, desk: Desk) -> Play:
    yield from stage.pause(1.0)
    stage.say(EmergencyStop(OPERATOR, Reason.OPERATOR))
    stop_us = stage.now_us
    yield from stage.pause(5.0)
    place = stage.last(Progress)
    is_told = place is not None and place.time_us >= stop_us and not place.message.speed_mm_s
    stage.judge("stop-on-the-way-tells-where", is_told, "no place where it stands", place)
    rest_us = stage.now_us
    mine = _held(stage, cast)
    for key in sorted(mine)[:3]:
        stage.say(TokenRequest(stage.other or stage.caller, *key, mine[key] & 0xFFFFF, 1, 0))
    yield from stage.pause(1.0)
    bid = yield from desk.asks(desk.call())
    stage.judge("stop-takes-no-task", bid is None, "it bids", bid)
    yield from stage.pause(10.0)
    given = stage.since(TokenGrant, rest_us)
    stage.none_of("stop-gives-nothing-to-who-asks", given, "gives a right away")
    lost = [key for key in mine if cast.holder(key)[0] != stage.node]
    stage.judge("stop-keeps-its-rights", not lost, f"has given {lost}")
    asked = stage.since(TokenRequest, rest_us + SECOND)
    stage.none_of("stop-asks-for-nothing", asked, "asks for rights")
    here = [one for one in stage.since(Progress, rest_us) if one.message.speed_mm_s]
    stage.none_of("stop-on-the-way-stands", here, "moves")
    beats = [one for one in stage.since(Heartbeat, rest_us) if one.message.state is not MachineState.OBSTACLE]
    stage.none_of("stop-tells-its-state", beats, "says another state")
    stage.say(Go(OPERATOR, OPERATOR))


CUT = Scene("power cuts at work", CUTS, cuts, needs_power=True, needs_car=True)
STOP = Scene("stops at work", STOPS, stops, needs_car=True)

"""One car parked and fetched: chapters 6, 9 and 10 of docs/protocol.md."""

from onboard.conform.cast import Cast, grants
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import SECOND, Heard, Play, Stage, Word, after_ms
from onboard.contract.codes import LegAction, MachineState, Operation, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    CallForProposals,
    CarAt,
    Heartbeat,
    Itinerary,
    TaskReport,
    TokenGrant,
    TokenRequest,
)
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.desk import Desk

_STARTED = "A robot says `TaskReport` STARTED with the station where it is to take the car when it is before it"
_ABOARD = (
    "When the shuttle is home with a car: `CarAt` with 65535 (aboard), then the "
    "station's token goes back to its keeper."
)
_LEFT = "When it is home without: `CarAt` with the station, then the car's token and the station's go to the keeper."
_BOTH = "It reaches in with both only."
_AGAIN = (
    "An award for me that is heard again is answered with how the task stands: "
    "AWARDED until the car is aboard, LOADED, DONE"
)
_ANEW = (
    "So is one for a task that I have begun or done, in whichever call of its initiator, where the car is the same: "
    "nothing is planned for it twice."
)
_VERSION = "`CarAt` says where a car is, under the version of its token: by its custodian only."

_COMES = "a compartment calls when somebody drives in (PARK, wheelbase 1500, raw 0: not measured)"
_NO_SOONER = "Who bids plans its work there no sooner, and sets its shuttle to the wheelbase of `CarAt`"
#: Who drives in has pressed the key by then, ms behind the deadline.
_READY_MS = 30_000

PARKED = (
    Check("bids-for-who-drives-in", "Q4", _COMES),
    Check("bids-no-sooner-than-the-bay-is-ready", "Q4", _NO_SOONER),
    Check("starts-before-the-bay", "U2", _STARTED),
    Check("start-names-the-bay", "U2", _STARTED),
    Check("says-that-it-works", "U2", _STARTED),
    Check("waits-for-the-bay", "C1", _BOTH),
    Check("waits-for-the-car", "C1", _BOTH),
    Check("asks-again-for-the-bay-soon", "K11", "or the token is no segment's and not grantable yet"),
    Check("car-is-aboard", "C3", _ABOARD),
    Check("car-is-told-under-its-version", "C2", _VERSION),
    Check("car-keeps-its-wheelbase", "C2", _VERSION),
    Check("bay-goes-back", "C3", _ABOARD),
    Check("bay-goes-back-behind-the-car", "C3", _ABOARD),
    Check("loaded-is-told", "U2", "LOADED when the car is aboard and its shuttle home"),
    Check("loaded-again-by-an-award", "U3", _AGAIN),
    Check("won-anew-with-its-car-aboard-is-told", "U3", _ANEW),
    Check("won-anew-with-its-car-aboard-makes-no-work", "U3", _ANEW),
    Check("keeps-a-car-aboard", "U5", "Where a robot has the car aboard nobody else can do it."),
    Check("asks-for-the-place", "C1", "A robot before a station asks for the tokens of station and car."),
    Check("car-is-left", "C3", _LEFT),
    Check("car-is-left-at-a-place", "C3", _LEFT),
    Check("car-goes-to-the-keeper", "C3", _LEFT),
    Check("place-goes-to-the-keeper", "C3", _LEFT),
    Check("car-is-told-before-it-goes", "C3", _LEFT),
    Check(
        "each-grant-of-a-car-has-its-place",
        "C3",
        ("Each repeated grant of the car's token has that `CarAt` before it."),
    ),
    Check("done-is-told", "U2", "DONE with the station where the car is left when the shuttle is home."),
    Check("done-names-the-place", "U2", ("DONE with the station where the car is left when the shuttle is home.")),
    Check("done-again-by-an-award", "U3", _AGAIN),
    Check("won-anew-when-done-is-told", "U3", _ANEW),
    Check("won-anew-when-done-makes-no-work", "U3", _ANEW),
    Check("is-idle-in-the-end", "U2", ("DONE with the station where the car is left when the shuttle is home.")),
)


def _report(stage: Stage, call: CallForProposals, phase: TaskPhase, within_s: float, since_us: int) -> Heard:
    return (
        yield from stage.hears(TaskReport, lambda one: one.task == call.task and one.phase is phase, within_s, since_us)
    )


def parked(stage: Stage, cast: Cast) -> Play:
    """It parks the car that stands in the bay."""
    desk = Desk(stage, cast, 0x0B00, 1_000)
    held_back = {TokenKind.STATION, TokenKind.CAR}
    cast.answer = lambda key, _: Reason.TOKEN_NOT_GRANTABLE_YET if key.kind in held_back else Reason.NONE
    call, bid = yield from desk.wins(wheelbase_mm=0, ready_ms=_READY_MS)
    stage.judge("bids-for-who-drives-in", bid, "no bid", bid)
    desk.place_car()
    if bid is None:
        return
    least_ms = _READY_MS + desk.handling_us(desk.bay) // 1000
    is_late = desk.over_ms(call, bid) >= least_ms
    stage.judge("bids-no-sooner-than-the-bay-is-ready", is_late, f"not {least_ms} ms behind the deadline", bid)
    begin_us = stage.now_us
    started = yield from _report(stage, call, TaskPhase.STARTED, 60.0, begin_us)
    stage.judge("starts-before-the-bay", started, "no STARTED within 60 s", started)
    if started is None:
        desk.withdraw(call)
        return
    stage.judge("start-names-the-bay", started.message.station == desk.bay.number, "another station", started)
    beat = yield from stage.hears(Heartbeat, within_s=3.0)
    is_at_work = beat is not None and beat.message.state in (MachineState.WORKING, MachineState.WAITING)
    stage.judge("says-that-it-works", is_at_work, "another state", beat)
    yield from _held_back(stage, cast, held_back)
    cast.answer = grants
    aboard = yield from stage.hears(CarAt, lambda one: one.station == ANY_STATION, 60.0)
    stage.judge("car-is-aboard", aboard, "no CarAt aboard within 60 s", aboard)
    if aboard is not None:
        yield from _taken(stage, cast, desk, call, aboard)
        yield from _left(stage, cast, desk, call, aboard.time_us)


def _held_back(stage: Stage, cast: Cast, held_back: set[TokenKind]) -> Play:
    begin_us = stage.now_us
    yield from stage.pause(4.0)
    asks = [one for one in stage.since(TokenRequest, begin_us) if one.message.token_kind is TokenKind.STATION]
    stage.judge("asks-again-for-the-bay-soon", 2 <= len(asks) <= 6, f"{len(asks)} times in 4 s", *asks)
    stage.none_of("waits-for-the-bay", stage.since(CarAt, begin_us), "takes the car without a right")
    held_back.discard(TokenKind.STATION)
    begin_us = stage.now_us
    # A shuttle that reaches in takes less than this.
    yield from stage.pause(25.0)
    stage.none_of("waits-for-the-car", stage.since(CarAt, begin_us), "takes the car without a right")
    _ = cast


def _taken(stage: Stage, cast: Cast, desk: Desk, call: CallForProposals, aboard: Word) -> Play:
    version = cast.holder(desk.car_key)[1] & 0xFFFF
    stage.judge("car-is-told-under-its-version", aboard.message.version == version, f"not {version}", aboard)
    is_same = aboard.message.wheelbase_mm == desk.wheelbase_mm
    stage.judge("car-keeps-its-wheelbase", is_same, f"not {desk.wheelbase_mm} mm", aboard)
    bay = (TokenKind.STATION, desk.bay.number)
    back = yield from stage.hears(
        TokenGrant, lambda one: (one.token_kind, one.token) == bay, 10.0, aboard.time_us - SECOND
    )
    is_back = back is not None and back.message.holder == stage.caller
    stage.judge("bay-goes-back", is_back, "not to its compartment within 10 s", aboard, back)
    stage.judge("bay-goes-back-behind-the-car", back and back.time_us >= aboard.time_us, "before CarAt", aboard, back)
    loaded = yield from _report(stage, call, TaskPhase.LOADED, 10.0, aboard.time_us - SECOND)
    stage.judge("loaded-is-told", loaded, "no LOADED within 10 s", loaded)
    begin_us = stage.now_us
    desk.award(call, stage.node)
    again = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 2.0, begin_us)
    stage.judge("loaded-again-by-an-award", again and again.message.phase is TaskPhase.LOADED, "not LOADED", again)
    begin_us = stage.now_us
    desk.award(call, stage.other or stage.stranger, task_version=2)
    yield from stage.pause(1.0)
    given = [one for one in stage.since(TaskReport, begin_us) if one.message.phase is TaskPhase.FORFEITED]
    stage.none_of("keeps-a-car-aboard", given, "gives a task back with the car aboard")
    yield from _won_anew(stage, desk, call, "with-its-car-aboard", TaskPhase.LOADED)


def _won_anew(stage: Stage, desk: Desk, of: CallForProposals, when: str, phase: TaskPhase) -> Play:
    """Its initiator has heard nothing of the task, and calls for it once more; who does not bid is not judged."""
    call = desk.call(task=of.task)
    told = stage.since(Itinerary, 0)[-1:]
    bid = yield from desk.asks(call, withdraws=False)
    if bid is None:
        return
    begin_us = stage.now_us
    desk.award(call, stage.node, task_version=3)
    said = yield from stage.hears(TaskReport, lambda one: one.task == of.task, 2.0, begin_us)
    stage.judge(f"won-anew-{when}-is-told", said and said.message.phase is phase, f"not {phase.name}", said)
    yield from stage.pause(0.5)
    most = max((_works(one) for one in told), default=0)
    more = [one for one in stage.since(Itinerary, begin_us) if _works(one) > most]
    stage.none_of(f"won-anew-{when}-makes-no-work", more, "plans more work than before")


def _works(plan: Word) -> int:
    return sum(leg.action is LegAction.WORK for leg in plan.message.legs)


def _left(stage: Stage, cast: Cast, desk: Desk, call: CallForProposals, begin_us: int) -> Play:
    asks = yield from stage.hears(TokenRequest, lambda one: one.token_kind is TokenKind.STATION, 60.0, begin_us)
    stage.judge("asks-for-the-place", asks, "no request for a place within 60 s", asks)
    # From here on nobody confirms what it gives.
    cast.confirms = False
    left = yield from stage.hears(CarAt, lambda one: one.station != ANY_STATION, 60.0, begin_us)
    stage.judge("car-is-left", left, "no CarAt at a place within 60 s", left)
    if left is None:
        cast.confirms = True
        return
    places = {place.number for place in desk.site.places}
    stage.judge("car-is-left-at-a-place", left.message.station in places, "no place of the site", left)
    yield from stage.pause(2.0)
    grants_of_car = [one for one in stage.since(TokenGrant, begin_us) if _key(one) == desk.car_key]
    keeper = desk.site.stewards[left.message.station >> 8]
    is_given = grants_of_car and grants_of_car[0].message.holder == keeper
    stage.judge("car-goes-to-the-keeper", is_given, f"not to node {keeper}", left, *grants_of_car)
    is_before = grants_of_car and left.time_us <= grants_of_car[0].time_us
    stage.judge("car-is-told-before-it-goes", is_before, "the grant came first", left, *grants_of_car)
    told = stage.since(CarAt, left.time_us)
    is_each = len(grants_of_car) > 1 and len(told) >= len(grants_of_car)
    what = f"{len(told)} CarAt for {len(grants_of_car)} grants"
    stage.judge("each-grant-of-a-car-has-its-place", is_each, what, *told, *grants_of_car)
    place = [one for one in stage.since(TokenGrant, begin_us) if _key(one) == (TokenKind.STATION, left.message.station)]
    is_back = place and place[0].message.holder == keeper
    stage.judge("place-goes-to-the-keeper", is_back, f"not to node {keeper}", *place)
    cast.confirms = True
    for key in (desk.car_key, TokenKey(TokenKind.STATION, left.message.station)):
        last = [one.message for one in stage.since(TokenGrant, begin_us) if _key(one) == key]
        if last:
            cast.hear(Word(stage.now_us, last[-1], left.frame))
    yield from _done(stage, desk, call, left)


def _done(stage: Stage, desk: Desk, call: CallForProposals, left: Word) -> Play:
    done = yield from _report(stage, call, TaskPhase.DONE, 10.0, left.time_us - SECOND)
    stage.judge("done-is-told", done, "no DONE within 10 s", done)
    if done is not None:
        stage.judge("done-names-the-place", done.message.station == left.message.station, "another", left, done)
    yield from stage.pause(1.0)
    begin_us = stage.now_us
    desk.award(call, stage.node)
    again = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 2.0, begin_us)
    stage.judge("done-again-by-an-award", again and again.message.phase is TaskPhase.DONE, "not DONE", again)
    yield from _won_anew(stage, desk, call, "when-done", TaskPhase.DONE)
    idle = yield from stage.hears(Heartbeat, lambda one: one.state is MachineState.IDLE, 60.0)
    stage.judge("is-idle-in-the-end", idle, "not idle within 60 s", idle)


def _key(word: Word) -> TokenKey:
    return TokenKey(word.message.token_kind, word.message.token)


FETCHED = (
    Check("bids-to-fetch", "B1", "with an operation and criterion that I know"),
    Check("fetch-is-awarded", "U1", "The answer to an award is a new FIRM itinerary with the award's stamp"),
    Check("fetch-starts-at-the-place", "U2", _STARTED),
    Check("fetched-car-is-aboard", "C3", _ABOARD),
    Check("place-goes-back", "C3", _ABOARD),
    Check("fetched-car-is-at-the-bay", "C3", _LEFT),
    Check("fetched-car-goes-to-the-compartment", "C3", "then the car's token and the station's go to the keeper."),
    Check("fetch-is-done", "U2", "DONE with the station where the car is left when the shuttle is home."),
    Check("fetch-is-done-when-it-was-promised", "B2", "What it promises it keeps as well as it can"),
    Check("plan-is-told-anew-only-where-it-changes", "P1", "under `version`, newer with each change"),
    Check("leaves-the-front-of-the-bay", "P5", ("A plan ends in a refuge: a segment that is before no compartment")),
)


def fetched(stage: Stage, cast: Cast) -> Play:
    """It fetches the car that it has parked."""
    desk = Desk(stage, cast, 0x0C00, 1_100)
    at = cast.cars.get(desk.car)
    if at is None or at.station in (ANY_STATION, desk.bay.number):
        return
    call = desk.call(operation=Operation.RETRIEVE, from_station=at.station, to_station=desk.bay.number)
    bid = yield from desk.asks(call, withdraws=False)
    stage.judge("bids-to-fetch", bid, "no bid", bid)
    if bid is None:
        return
    begin_us = stage.now_us
    desk.award(call, stage.node)
    awarded = yield from _report(stage, call, TaskPhase.AWARDED, 3.0, begin_us)
    stage.judge("fetch-is-awarded", awarded, "no AWARDED within 3 s", awarded)
    started = yield from _report(stage, call, TaskPhase.STARTED, 60.0, begin_us)
    is_there = started is not None and started.message.station == at.station
    stage.judge("fetch-starts-at-the-place", is_there, "no STARTED there within 60 s", started)
    aboard = yield from stage.hears(CarAt, lambda one: one.station == ANY_STATION, 60.0, begin_us)
    stage.judge("fetched-car-is-aboard", aboard, "no CarAt aboard within 60 s", aboard)
    if aboard is None:
        return
    yield from stage.pause(2.0)
    place = [one for one in stage.since(TokenGrant, begin_us) if _key(one) == (TokenKind.STATION, at.station)]
    stage.judge("place-goes-back", place, "the place's token stays away", *place)
    left = yield from stage.hears(CarAt, lambda one: one.station == desk.bay.number, 60.0, aboard.time_us)
    stage.judge("fetched-car-is-at-the-bay", left, "no CarAt at the bay within 60 s", left)
    yield from stage.pause(2.0)
    given = [one for one in stage.since(TokenGrant, aboard.time_us) if _key(one) == desk.car_key]
    is_given = given and given[-1].message.holder == stage.caller
    stage.judge("fetched-car-goes-to-the-compartment", is_given, "not to the compartment", *given)
    done = yield from _report(stage, call, TaskPhase.DONE, 10.0, begin_us)
    stage.judge("fetch-is-done", done, "no DONE within 10 s", done)
    if done is not None:
        late_ms = after_ms(stage.bus_ms(), bid.message.cost)
        stage.judge("fetch-is-done-when-it-was-promised", abs(late_ms) <= 3_000, f"{late_ms} ms later", bid, done)
        plans = stage.since(Itinerary, begin_us)
        # As many as it has steps: one that is over may have taken a little longer or shorter.
        stage.judge("plan-is-told-anew-only-where-it-changes", len(plans) <= 10, f"{len(plans)} times", *plans)
    front = TokenKey(TokenKind.SEGMENT, desk.bay.segment.number)
    is_free = yield from stage.until(lambda: cast.holder(front)[0] != stage.node, 60.0)
    stage.judge("leaves-the-front-of-the-bay", is_free, "still before the bay after 60 s")
    yield from stage.pause(15.0)


SCENES = (
    Scene("parking", PARKED, parked, needs_car=True),
    Scene("fetching", FETCHED, fetched, needs_car=True),
)

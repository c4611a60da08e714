"""Who gives way, who is in the way, and all or none: duties J4, J6, J7, P7 and K13 of docs/protocol.md."""

from onboard.conform.cast import Cast, grants
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import SECOND, Play, Stage, Word
from onboard.contract.codes import Grade, LegAction, MachineState, Reason, TokenKind
from onboard.contract.messages import (
    Bid,
    Heartbeat,
    Itinerary,
    Progress,
    Stamp,
    TokenGrant,
    TokenHeld,
    TokenRequest,
    Waiting,
)
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey, genesis_holder
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.conform.rival import Rival, meeting

_BODY = "Its body, and the segments whose tokens it holds, are in the way of all plans."
_SINCE = "a robot only once it has told a firm itinerary since."
_STANDS = "or that is a robot and stands where its plan has left for `T_stands`"
_WAITS = "(`T_waits` where it says `Waiting`, `TaskReport`, `TokenRequest` or plans meanwhile)"
_VOID = (
    "Of an obstacle bids do not count, plans are not planned around, and nobody comes behind it in an order of passing."
)

IN_THE_WAY = (
    Check("body-of-an-obstacle-is-in-the-way", "J7", _BODY),
    Check("obstacle-without-rights-is-in-the-way", "J7", _BODY),
    Check("rights-of-an-obstacle-are-in-the-way", "J7", _BODY),
    Check("plan-of-an-obstacle-is-not-in-the-way", "J7", _VOID),
    Check("bids-when-an-obstacle-has-gone", "J7", _BODY),
    Check("robot-with-a-plan-takes-part-again", "J6", _SINCE),
    Check("robot-that-drives-takes-part", "J6", _STANDS),
    Check("robot-that-says-it-waits-takes-part", "J6", _WAITS),
    Check("robot-that-stands-is-an-obstacle", "J6", _STANDS),
    Check("robot-that-lives-anew-has-no-plan", "R4", "I forget the plan, but not where its body is."),
    Check("robot-that-lives-anew-is-where-it-was", "R4", "I forget the plan, but not where its body is."),
)


def in_the_way(stage: Stage, cast: Cast) -> Play:
    """Another robot is an obstacle: by its body, by its rights, without a plan, and by standing still."""
    desk = Desk(stage, cast, 0x1200, 1_700)
    desk.place_car()
    rival = Rival(stage, cast, desk)
    calm = yield from desk.asks(call := desk.call())
    if calm is None:
        return
    least_ms = desk.over_ms(call, calm)
    side = 1 if desk.segment_at(rival.home.track, 0).index > desk.bay.index else -1
    mouth = desk.segment_at(rival.home.track, 0)
    near = Segment(desk.bay.track, desk.bay.index + side)
    part = cast.parts[rival.node]

    def state(one: MachineState) -> Play:
        part.state = one
        cast.beat(part)
        yield from stage.pause(2.5)

    def bids(name: str, *, wanted: bool) -> Play:
        bid = yield from desk.asks(desk.call())
        stage.judge(name, (bid is not None) is wanted, "no bid" if wanted else "it bid", bid)

    rival.stands(near)
    yield from state(MachineState.OBSTACLE)
    yield from bids("obstacle-without-rights-is-in-the-way", wanted=False)
    rival.takes(near)
    yield from stage.pause(2.5)
    yield from bids("body-of-an-obstacle-is-in-the-way", wanted=False)
    rival.stands()
    yield from stage.pause(2.5)
    yield from bids("rights-of-an-obstacle-are-in-the-way", wanted=False)
    rival.gives_back(near)
    yield from stage.pause(2.5)
    yield from bids("bids-when-an-obstacle-has-gone", wanted=True)
    rival.way((desk.bay.index, 90.0)).into(rival.home.track).tell()
    yield from stage.pause(0.5)
    bid = yield from desk.asks(call := desk.call())
    is_free = bid is not None and desk.over_ms(call, bid) <= least_ms + 30_000
    stage.judge("plan-of-an-obstacle-is-not-in-the-way", is_free, "plans around it", calm, bid)
    yield from _takes_part(stage, cast, desk, rival, least_ms)
    _ = mouth


def _takes_part(stage: Stage, cast: Cast, desk: Desk, rival: Rival, least_ms: int) -> Play:
    """Its bid counts, or does not."""
    part = cast.parts[rival.node]

    place = stage.last(Progress)
    taken = (rival.home.track, 0 if place is None else place.message.track)
    free = next(one.number for one in desk.site.tracks.values() if one.low is not None and one.number not in taken)

    def against(name: str, *, counts: bool) -> Play:
        call = desk.call()
        cost = (call.deadline_ms + least_ms - 1_000) % 2**32
        bid = yield from desk.asks(call, Bid(rival.node, call.sender, call.call, cost, 0))
        stage.judge(name, (bid is None) is counts, "bids though it is beaten" if counts else "no bid", bid)

    part.state = MachineState.IDLE
    cast.beat(part)
    rival.stands()
    yield from stage.pause(2.5)
    yield from against("robot-with-a-plan-takes-part-again", counts=True)
    rival.way((desk.bay.index, 5.0)).into(rival.home.track).tell()
    rival.is_at(rival.home, leg=0)
    yield from stage.pause(5.0)
    rival.stands()
    yield from stage.pause(2.5)
    yield from against("robot-that-drives-takes-part", counts=True)
    part.lives_anew()
    part.state = MachineState.STARTING
    cast.plans.pop(rival.node)
    cast.beat(part)
    yield from stage.pause(2.5)
    beats = stage.since(Heartbeat, stage.now_us - 2 * SECOND)
    is_told = beats and beats[-1].message.mirror_digest == cast.digest()
    stage.judge("robot-that-lives-anew-has-no-plan", is_told, f"not {cast.digest():04X}", *beats)
    part.state = MachineState.IDLE
    cast.stand(rival.node)
    yield from stage.pause(3.0)
    yield from against("robot-that-lives-anew-is-where-it-was", counts=True)
    rival.way((desk.bay.index, 2.0)).into(free).tell()
    rival.is_at(rival.home, leg=0)
    mouth = desk.segment_at(rival.home.track, 0)
    for _ in range(8):
        stage.say(Waiting(rival.node, mouth.track, mouth.index, stage.caller, Reason.TOKEN_NOT_GRANTABLE_YET))
        yield from stage.pause(9.0)
    yield from against("robot-that-says-it-waits-takes-part", counts=True)
    yield from stage.pause(30.0)
    yield from against("robot-that-stands-is-an-obstacle", counts=False)
    # Only motion ends that.
    rival.is_at(desk.segment_at(rival.home.track, 0), speed_mm_s=500)
    rival.stands()
    yield from stage.pause(3.0)


_LOWER = "Of two plans that meet and were made at the same time the lower stamp"
_ANEW = "The other makes its plan anew and tells it, under its old stamp"

YIELDS = (
    Check("higher-stamp-gives-way", "P7", _LOWER),
    Check("gives-way-under-its-old-stamp", "P7", _ANEW),
    Check("keeps-to-the-other-plan", "P6", "no window of mine overlaps one of theirs by more than `T_round`."),
    Check("lower-stamp-keeps-its-windows", "P7", _LOWER),
    Check("keeps-its-plan-though-it-is-told-one", "P7", _LOWER),
    Check("who-holds-the-token-goes-first", "P7", "whoever holds the segment's token goes first"),
)


def yields(stage: Stage, cast: Cast) -> Play:
    """Both plan at the same time, with one stamp below the other."""
    desk = Desk(stage, cast, 0x1300, 1_800)
    desk.place_car()
    rival = Rival(stage, cast, desk)
    for name, older in (("higher-stamp-gives-way", True), ("lower-stamp-keeps-its-windows", False)):
        cast.answer = lambda key, _: (
            Reason.NONE if key.kind is TokenKind.SEGMENT and key.number >> 8 > 127 else Reason.TOKEN_NOT_GRANTABLE_YET
        )
        yield from _at_once(stage, desk, rival, name, older=older)
        cast.answer = grants
        rival.stands()
        yield from stage.pause(45.0)
    cast.answer = lambda key, _: (
        Reason.NONE if key.kind is TokenKind.SEGMENT and key.number >> 8 > 127 else Reason.TOKEN_NOT_GRANTABLE_YET
    )
    mouth = desk.segment_at(rival.home.track, 0)
    low, high = sorted((mouth.index, desk.bay.index))
    way = [Segment(mouth.track, index) for index in range(low, high + 1)]
    rival.takes(*way)
    yield from stage.pause(1.0)
    yield from _at_once(stage, desk, rival, "who-holds-the-token-goes-first", older=False, holds=True)
    cast.answer = grants
    rival.stands()
    rival.gives_back(*way)
    yield from stage.pause(45.0)


def _at_once(stage: Stage, desk: Desk, rival: Rival, name: str, *, older: bool, holds: bool = False) -> Play:
    call, bid = yield from desk.wins()
    if bid is None:
        return
    begin_us = stage.now_us
    plan = yield from stage.hears(Itinerary, lambda one: one.grade is Grade.FIRM, 3.0, begin_us)
    if plan is None:
        return
    mine = plan.message.stamp
    stamp = Stamp((mine.award_ms + (-500 if older else 500)) % 2**32, stage.caller, 0xD0 if older else 0xD1)
    rival.way((desk.bay.index, 30.0)).into(rival.home.track).tell(stamp)
    told_us = stage.now_us
    yield from stage.pause(2.0)
    said = [one for one in stage.since(Itinerary, told_us + 1) if one.message.grade is Grade.FIRM]
    anew = said[-1] if said else None
    if older:
        works = anew is not None and any(leg.action is LegAction.WORK for leg in anew.message.legs)
        stage.judge(name, works, "does not make its plan anew", plan, anew)
        if anew is not None:
            is_same = anew.message.stamp[1:] == mine[1:]
            stage.judge("gives-way-under-its-old-stamp", is_same, "another stamp", plan, anew)
            meets = meeting(desk, anew.message, rival.plan, stage.bus_us // 1000)
            stage.judge("keeps-to-the-other-plan", meets is None, f"{meets}", anew)
    elif holds:
        stage.judge(name, anew, "keeps its windows before who holds the tokens", plan, anew)
    else:
        stage.judge(name, anew is None, "makes its plan anew", plan, anew)
        last = stage.last(Itinerary)
        is_same = last is not None and last.message.version == plan.message.version
        stage.judge("keeps-its-plan-though-it-is-told-one", is_same, "another plan", plan, last)
    yield from stage.pause(1.0)
    desk.withdraw(call)
    yield from stage.pause(2.0)


_ALL = (
    "Where no order comes about for `T_order`, a robot asks for all segments to its next refuge with "
    "`itinerary_version` 0."
)
_WHOLE = "It moves when it has all; what it has of an incomplete set it gives back to the stewards after `T_whole`"
ALL_OR_NONE = (
    Check("asks-for-all-or-none", "K13", _ALL),
    Check("asks-not-at-once-for-all", "K13", _ALL),
    Check("all-is-all-to-a-refuge", "K13", _ALL),
    Check("moves-only-with-all", "K13", _WHOLE),
    Check("gives-an-incomplete-set-back", "K13", _WHOLE),
    Check("keeps-what-its-body-is-in", "K13", "but for what its body is in, and asks again later."),
    Check("asks-again-for-all", "K13", "but for what its body is in, and asks again later."),
    Check("moves-with-all", "K13", _WHOLE),
)


def all_or_none(stage: Stage, cast: Cast) -> Play:
    """No order comes about: all is refused with MIRROR_BEHIND, then all but one segment is granted, then all."""
    desk = Desk(stage, cast, 0x1400, 1_900)
    desk.place_car()
    cast.answer = lambda _, __: Reason.MIRROR_BEHIND
    call, bid = yield from desk.wins()
    if bid is None:
        return
    begin_us = stage.now_us
    first = yield from stage.hears(TokenRequest, _is_of_all, 30.0, begin_us)
    stage.judge("asks-for-all-or-none", first, "never asks with itinerary_version 0", first)
    asked = stage.since(TokenRequest, begin_us)
    if first is None or not asked:
        desk.withdraw(call)
        return
    waited_us = first.time_us - asked[0].time_us
    stage.judge(
        "asks-not-at-once-for-all", waited_us >= 5 * SECOND - 4 * stage.means.late_us, f"after {waited_us} us", first
    )
    yield from stage.pause(2.5)
    wanted = {_key(one) for one in stage.since(TokenRequest, first.time_us) if _is_of_all(one.message)}
    is_all = not stage.rival or len(wanted) > 1
    stage.judge("all-is-all-to-a-refuge", is_all, f"only {sorted(wanted)}, where no refuge is", first)
    yield from _some(stage, cast, sorted(wanted))
    cast.answer = grants
    begin_us = stage.now_us
    again = yield from stage.hears(TokenRequest, _is_of_all, 30.0, begin_us)
    stage.judge("asks-again-for-all", again, "asks no more", again)
    moved = yield from stage.hears(Progress, lambda one: one.speed_mm_s != 0, 30.0, begin_us)
    stage.judge("moves-with-all", moved, "does not move", moved)
    yield from stage.pause(5.0)
    desk.withdraw(call)
    yield from stage.pause(60.0)


def _some(stage: Stage, cast: Cast, wanted: list[TokenKey]) -> Play:
    """It gets all but one."""
    missing = wanted[len(wanted) // 2]
    cast.answer = lambda key, request: (
        Reason.NONE if _is_of_all(request) and key != missing else Reason.TOKEN_NOT_GRANTABLE_YET
    )
    place = stage.last(Progress)
    begin_us = stage.now_us
    got = yield from stage.hears(TokenHeld, within_s=10.0)
    yield from stage.pause(5.0)
    moves = [one for one in stage.since(Progress, begin_us) if one.message.speed_mm_s]
    stage.none_of("moves-only-with-all", moves, "moves without all")
    back = [one for one in stage.since(TokenGrant, begin_us) if _key(one) in wanted]
    stewards = [one for one in back if one.message.holder == genesis_holder(stage.site, _key(one))]
    stage.judge("gives-an-incomplete-set-back", back and len(stewards) == len(back), "gives nothing back", got, *back)
    if place is not None:
        own = Desk(stage, cast).segment_key(place.message.track, place.message.index)
        kept = cast.holder(own)[0] == stage.node
        stage.judge("keeps-what-its-body-is-in", kept, "gives away what its body is in", place, *back)


def _is_of_all(one: TokenRequest) -> bool:
    return one.token_kind is TokenKind.SEGMENT and one.itinerary_version == 0


def _key(word: Word) -> TokenKey:
    return TokenKey(word.message.token_kind, word.message.token)


SCENES = (
    Scene("all or none", ALL_OR_NONE, all_or_none, needs_car=True, needs_rival=True),
    Scene("another robot in the way", IN_THE_WAY, in_the_way, needs_car=True, needs_rival=True),
    Scene("giving way", YIELDS, yields, needs_car=True, needs_rival=True),
)

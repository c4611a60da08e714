"""Lifts that are asked before a bid: sub-calls, duties B11 to B13 and L2 of docs/protocol.md."""

from collections.abc import Generator

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import MS, SECOND, Play, Stage, Wait, Word, after_ms
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation
from onboard.contract.messages import Award, Bid, CallForProposals, Reference
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.conform.platforms import Platform, platform_of

_EACH = "then a robot opens a sub-call RIDE for each before it bids."
_OPENS = (
    "it opens a call for each part: `depth` one more than that of the call (7 at most), `parent` that call's initiator"
)
_DEADLINE = "Their deadline is half of the time (or what the site says) that is left until 2 `T_guard` before the outer"
_HOLD = "`hold_ms` tells how long an answer is kept: to the outer deadline, what that is held itself, and `T_hold`."
_SHORT = "if that is less than 4 `T_guard`, it says nothing."
_OPTION = "At its deadline its initiator says `Award` with OPTION to the best bidder"
_OUTBID = "Who is outbid says WITHDRAWN to all its options"
_AFTER = (
    "Who hears that another bidder asks others for the same call asks only after "
    "that one's answer, where there is time."
)

ASKED = (
    Check("asks-the-lift-before-it-bids", "L2", _EACH),
    Check("asks-when-its-delay-is-over", "B11", "When its delay is over and nobody was better"),
    Check("asks-for-each-ride", "L2", _EACH),
    Check("asks-lifts-by-time", "L2", _EACH),
    Check("sub-call-is-one-deeper", "B11", _OPENS),
    Check("sub-call-names-its-parent", "B11", _OPENS),
    Check("sub-call-has-the-whole-task", "B11", _OPENS),
    Check("parts-are-numbered", "B11", "`part` from 1 (15 at most)."),
    Check("sub-call-takes-half-of-the-time", "B11", _DEADLINE),
    Check("sub-call-tells-how-long-it-holds", "B11", _HOLD),
    Check("bids-though-no-lift-answers", "B12", "A sub-call is opened once."),
    Check("sub-call-is-opened-once", "B12", "A sub-call is opened once."),
    Check("what-is-promised-is-not-asked-again", "B12", "A sub-call is opened once."),
    Check("best-bidder-has-the-option", "B12", _OPTION),
    Check("option-comes-at-the-deadline", "B12", _OPTION),
    Check("late-answer-is-no-option", "B12", _OPTION),
    Check("bid-comes-behind-the-answers", "L2", _EACH),
    Check("options-go-when-it-is-outbid", "B12", _OUTBID),
    Check("options-go-for-nobody-else", "B12", _OUTBID),
    Check("bid-goes-by-the-lifts-answer", "B2", "What it promises it keeps as well as it can"),
    Check("asks-nobody-where-it-is-beaten", "B11", "When its delay is over and nobody was better"),
    Check("asks-nobody-where-time-is-short", "B11", _SHORT),
    Check("bids-not-where-time-is-short", "B11", _SHORT),
    Check("asks-after-anothers-answer", "B13", _AFTER),
    Check("asks-behind-another-where-there-is-time", "B13", _AFTER),
)
#: How much later a lift may answer than it was asked for, ms: the robot plans anew around it.
_LATE_MS = 20_000
#: A call so short that half of what is left of it is too little to ask in, us.
_SHORT_US = 230 * MS
#: When another asks others for the same call, and until when, us behind the call.
_OTHER_ASKS_US = 250 * MS
Asked = Generator[Wait, None, tuple[CallForProposals, list[Word], Word | None]]


def asked(stage: Stage, cast: Cast) -> Play:
    """Calls for what needs two rides, which the lift answers or not; none is awarded."""
    desk, lift = Desk(stage, cast, 0x1C00, 2_700), platform_of(cast)
    desk.place_car()
    yield from stage.pause(1.5)
    lift.late_ms = None
    begin_us = stage.now_us
    call, subs, bid = yield from _asks(stage, desk)
    stage.judge("asks-the-lift-before-it-bids", subs, "no sub-call RIDE", *subs)
    stage.judge("bids-though-no-lift-answers", bid, "no bid", *subs)
    if not subs:
        return
    _judge_subs(stage, lift, call, subs)
    if bid is not None:
        owed_us = desk.delay_us((desk.over_ms(call, bid) - desk.floor_over_ms()) * MS)
        waited_us = subs[0].time_us - begin_us
        is_then = owed_us - 2 * MS <= waited_us <= owed_us + stage.means.late_us
        what = f"after {waited_us} us; its delay is {owed_us} us"
        stage.judge("asks-when-its-delay-is-over", is_then, what, subs[0], bid)
    numbers = [one.message.call for one in stage.since(CallForProposals, begin_us)]
    is_once = len(numbers) == len(set(numbers)) and all(one.message.attempt == 1 for one in subs)
    stage.judge("sub-call-is-opened-once", is_once, "again under the same number, or as a further attempt", *subs)
    lift.late_ms = 0
    first = yield from _answered(stage, desk, lift)
    if first is not None:
        yield from _late(stage, desk, lift, first)
        yield from _beaten(stage, desk, first)
    yield from _short(stage, desk)
    yield from _another(stage, desk, lift)
    _ = cast


def _asks(stage: Stage, desk: Desk, window_us: int = 0) -> Asked:
    """Open a call, and withdraw it behind its deadline: the call, the sub-calls for it, and the bid."""
    begin_us = stage.now_us
    window_us = window_us or desk.site.timing.call_window_us
    call = desk.call(deadline_ms=stage.bus_ms(stage.bus_us + window_us))
    stage.say(call)
    yield Wait(begin_us + window_us + 20_000)
    bid = desk.bid_of(call, begin_us)
    subs = _subs(stage, call, begin_us)
    desk.withdraw(call)
    yield from stage.pause(1.0)
    return call, subs, bid


def _subs(stage: Stage, call: CallForProposals, begin_us: int) -> list[Word]:
    """What the node has called for as a part of the task of a call."""
    words = stage.since(CallForProposals, begin_us)
    return [one for one in words if one.message.operation is Operation.RIDE and one.message.task == call.task]


def _judge_subs(stage: Stage, lift: Platform, call: CallForProposals, subs: list[Word]) -> None:
    site, timing, asks = lift.site, lift.site.timing, [one.message for one in subs]
    doors = [door.number for door in site.tracks[lift.track].joins]
    wanted = {(one.from_station, one.to_station) for one in asks}
    both = {(doors[1], doors[0]), (doors[0], doors[1])}
    stage.judge("asks-for-each-ride", wanted == both, f"asks for {sorted(wanted)}", *subs)
    is_known = all(one.kind is KindCode.LIFT and one.criterion is Criterion.FINISH_TIME for one in asks)
    stage.judge("asks-lifts-by-time", is_known, "another kind or criterion", *subs)
    is_deeper = all(one.depth == call.depth + 1 for one in asks)
    stage.judge("sub-call-is-one-deeper", is_deeper, f"not {call.depth + 1} deep", *subs)
    parent = Reference(call.sender, call.call)
    stage.judge("sub-call-names-its-parent", all(one.parent == parent for one in asks), f"not {parent}", *subs)
    is_whole = all((one.car, one.wheelbase_mm) == (call.car, call.wheelbase_mm) for one in asks)
    stage.judge("sub-call-has-the-whole-task", is_whole, "another load", *subs)
    parts = [one.part for one in asks]
    is_numbered = parts == list(range(1, len(parts) + 1)) and len(parts) <= 15
    stage.judge("parts-are-numbered", is_numbered, f"{parts}", *subs)
    late_ms, guard_ms = stage.means.late_us // MS, timing.deadline_guard_us // MS
    bus_off_us = stage.bus_us - stage.now_us
    halves, holds = [], []
    for word in subs:
        said_ms = (word.time_us + bus_off_us) // MS
        left_ms = after_ms(call.deadline_ms, said_ms % 2**32) - 2 * guard_ms
        halves.append(after_ms(word.message.deadline_ms, said_ms % 2**32) - left_ms * timing.sub_call_percent // 100)
        until_ms = after_ms(call.deadline_ms, word.message.deadline_ms) + 10 * timing.award_repeat_us // MS
        holds.append(word.message.hold_ms - until_ms)
    is_half = all(abs(one) <= late_ms for one in halves)
    stage.judge("sub-call-takes-half-of-the-time", is_half, f"away from half by {halves} ms", *subs)
    # A quarter of a second is the step in which frames tell it.
    is_held = all(0 <= one <= 250 for one in holds)
    stage.judge("sub-call-tells-how-long-it-holds", is_held, f"longer by {holds} ms", *subs)


def _options(stage: Stage, begin_us: int, result: CallResult = CallResult.OPTION) -> list[Word]:
    return [one for one in stage.since(Award, begin_us) if one.message.result is result]


def _answered(stage: Stage, desk: Desk, lift: Platform) -> Generator[Wait, None, int | None]:
    """The lift answers as it was asked; then somebody outbids. The bid's cost in ms behind its deadline."""
    begin_us = stage.now_us
    call = desk.call()
    stage.say(call)
    bid = yield from stage.hears(Bid, lambda one: one.call == call.call, 1.0)
    subs, options = _subs(stage, call, begin_us), _options(stage, begin_us)
    numbers = {one.message.call for one in subs}
    is_its = {one.message.call for one in options} == numbers and {one.message.winner for one in options} == {lift.node}
    stage.judge("best-bidder-has-the-option", is_its and numbers, f"not node {lift.node} for each", *subs, *options)
    bus_off_us = stage.bus_us - stage.now_us
    ends = {one.message.call: one.message.deadline_ms for one in subs}
    late = [
        after_ms((one.time_us + bus_off_us) // MS % 2**32, ends[one.message.call])
        for one in options
        if one.message.call in ends
    ]
    is_then = all(-1 <= one <= stage.means.late_us // MS for one in late)
    stage.judge("option-comes-at-the-deadline", is_then and late, f"later by {late} ms", *subs, *options)
    stage.judge("what-is-promised-is-not-asked-again", len(subs) <= 2, f"{len(subs)} sub-calls for two rides", *subs)
    last_us = max((one.time_us for one in options), default=begin_us)
    stage.judge("bid-comes-behind-the-answers", bid and bid.time_us >= last_us, "no bid behind them", *options, bid)
    if bid is None:
        return None
    stage.none_of("options-go-for-nobody-else", _options(stage, begin_us, CallResult.WITHDRAWN), "before it is outbid")
    outbid_us = stage.now_us
    stage.say(Bid(stage.lift, call.sender, call.call, (bid.message.cost - 2_000) % 2**32, 0))
    yield from stage.pause(0.3)
    gone = _options(stage, outbid_us, CallResult.WITHDRAWN)
    is_all = {one.message.call for one in gone} == numbers
    stage.judge("options-go-when-it-is-outbid", is_all, "not WITHDRAWN for each", *options, *gone)
    yield from stage.pause(1.0)
    desk.withdraw(call)
    yield from stage.pause(1.0)
    return desk.over_ms(call, bid)


def _late(stage: Stage, desk: Desk, lift: Platform, first_ms: int) -> Play:
    """The lift answers far later than it was asked for; then so late that the sub-call is over."""
    lift.late_ms = _LATE_MS
    call, _, bid = yield from _asks(stage, desk)
    by_ms = desk.over_ms(call, bid) - first_ms if bid is not None else 0
    is_later = bid is None or by_ms >= _LATE_MS - 1_000
    stage.judge("bid-goes-by-the-lifts-answer", is_later, f"later by {by_ms} ms, the lift by {_LATE_MS}", bid)
    lift.late_ms = None
    begin_us = stage.now_us
    call = desk.call()
    stage.say(call)
    sub = yield from stage.hears(CallForProposals, lambda one: one.task == call.task, 1.0)
    if sub is not None:
        yield Wait(sub.time_us + after_ms(sub.message.deadline_ms, stage.bus_ms()) * MS + 2 * MS)
        stage.say(Bid(lift.node, sub.message.sender, sub.message.call, sub.message.deadline_ms + 30_000, 0))
        yield from stage.pause(0.1)
        said = [one for one in _options(stage, begin_us) if one.message.call == sub.message.call]
        stage.none_of("late-answer-is-no-option", said, "an option for who answered behind the deadline")
    yield Wait(begin_us + SECOND)
    desk.withdraw(call)
    lift.late_ms = 0
    yield from stage.pause(1.0)


def _beaten(stage: Stage, desk: Desk, first_ms: int) -> Play:
    """Somebody is better before the node's delay is over."""
    begin_us = stage.now_us
    call = desk.call()
    better = Bid(stage.lift, call.sender, call.call, (call.deadline_ms + first_ms - 2_000) % 2**32, 0)
    yield from desk.asks(call, better)
    subs = _subs(stage, call, begin_us)
    stage.none_of("asks-nobody-where-it-is-beaten", subs, "asks for a bid that would not be better")
    yield from stage.pause(1.0)


def _short(stage: Stage, desk: Desk) -> Play:
    _, subs, bid = yield from _asks(stage, desk, _SHORT_US)
    stage.none_of("asks-nobody-where-time-is-short", subs, "asks though nobody can answer in time")
    stage.judge("bids-not-where-time-is-short", bid is None, "bids without having asked", bid)


def _another(stage: Stage, desk: Desk, lift: Platform) -> Play:
    """Another asks others for the same call first."""
    begin_us = stage.now_us
    call = desk.call()
    deadline_ms = stage.bus_ms(stage.bus_us + _OTHER_ASKS_US)
    doors = lift.site.tracks[lift.track].joins
    other = desk.call(
        sender=stage.lift,
        call=0x7000 + desk.number,
        task=call.task,
        operation=Operation.RIDE,
        kind=KindCode.LIFT,
        depth=1,
        part=1,
        parent=Reference(call.sender, call.call),
        deadline_ms=deadline_ms,
        from_station=doors[1].number,
        to_station=doors[0].number,
        hold_ms=1_500,
    )
    stage.say(call)
    yield from stage.pause(0.005)
    stage.say(other)
    yield Wait(begin_us + desk.site.timing.call_window_us + 20_000)
    subs = _subs(stage, call, begin_us)
    early = [one for one in subs if one.time_us < begin_us + _OTHER_ASKS_US - 2 * MS]
    stage.none_of("asks-after-anothers-answer", early, "asks before that one has its answer")
    stage.judge("asks-behind-another-where-there-is-time", subs, "asks nobody", *subs)
    desk.withdraw(call)
    yield from stage.pause(1.0)


SCENES = (Scene("asking the lift", ASKED, asked, needs_lift=True),)

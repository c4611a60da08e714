"""Calls and bids: chapter 4 of docs/protocol.md, and sets of frames (F4)."""

from collections.abc import Callable, Generator
from typing import Any

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import MS, Play, Stage, Wait, Word
from onboard.contract.codes import Criterion, Grade, KindCode, MachineState, Operation, Reason
from onboard.contract.messages import Bid, BusTime, CallForProposals, Diagnostic, Itinerary, LeftOut, TaskReport
from onboard.systems.car_park.conform.desk import Desk

#: A bid that comes sooner cannot be beaten by a word that is said 2 ms after the call, on a bus that others use too.
_TIME_FOR_A_WORD_US = 20 * MS
#: A call is said again so long after it, s.
_AGAIN_S = 0.03
_COUNTS = "I bid only if my cost beats the best bid heard that counts."
_COUNTS_NOT = (
    "Bids do not count of obstacles, of nodes that the call [leaves "
    "out](#5-opening-calls-and-awarding), below the floor"
)
_NOTHING = "Who cannot do the task, or not better, says nothing."
_LOOKS = "I look at a call of `kind` ANY or mine, with an operation and criterion that I know, that I can still answer"
_SET = "A call is the set `Call`, `CallTerms`, `CallLoad` with one sender and one `call`"

BIDS = (
    Check("bids-on-a-call", "B1", _LOOKS),
    Check("bids-again-on-the-next", "B1", _LOOKS),
    Check("bids-for-any-kind", "B1", _LOOKS),
    Check("bids-for-another-initiator", "B1", _LOOKS),
    Check("bid-tells-no-plan", "B8", "`itinerary_version` is 0, and no plan is told with a bid"),
    Check(
        "bid-is-not-below-the-floor",
        "B3",
        ("The *floor* of a call is what no machine can beat, from call and site alone"),
    ),
    Check("bid-waits-its-delay", "B4", "I bid when my delay since I heard the call is over"),
    Check("bid-is-not-late", "B4", "I bid when my delay since I heard the call is over"),
    Check("bid-is-in-its-slot", "B4", "It is moved to my slot"),
    Check(
        "the-same-call-costs-the-same",
        "B2",
        ("For FINISH_TIME it is the bus time, in ms, at which the task will be over"),
    ),
    Check("bids-once", "B5", "So the bids of one call strictly improve on the bus."),
    Check("no-award-no-work", "B9", "A bid that was best at the deadline without one is no right."),
    Check("no-award-no-plan", "B9", "A bid that was best at the deadline without one is no right."),
)


def bids(stage: Stage, cast: Cast) -> Play:
    """Plain calls, and what a bid says and does not say."""
    desk = Desk(stage, cast)
    desk.place_car()
    yield from stage.pause(1.5)
    begin_us = stage.now_us
    call = desk.call()
    bid = yield from desk.asks(call, withdraws=False)
    stage.judge("bids-on-a-call", bid, "no bid", bid)
    if bid is not None:
        _judge_bid(stage, desk, call, bid, begin_us)
        yield from stage.pause(4.0)
        mine = [one for one in stage.since(Bid, begin_us) if one.message.call == call.call]
        stage.judge("bids-once", len(mine) == 1, f"{len(mine)} bids", *mine)
        stage.none_of("no-award-no-work", stage.since(TaskReport, begin_us), "reports a task without an award")
        plans = [one for one in stage.since(Itinerary, begin_us) if one.message.grade is Grade.FIRM]
        stage.none_of("no-award-no-plan", plans, "a firm plan without an award")
    desk.withdraw(call)
    yield from stage.pause(0.5)
    again = desk.call()
    second = yield from desk.asks(again)
    stage.judge("bids-again-on-the-next", second, "no bid", second)
    if bid is not None and second is not None:
        apart_ms = desk.over_ms(again, second) - desk.over_ms(call, bid)
        stage.judge("the-same-call-costs-the-same", abs(apart_ms) <= 50, f"{apart_ms} ms apart", bid, second)
    others: dict[str, dict[str, Any]] = {"bids-for-any-kind": {"kind": KindCode.ANY}}
    if stage.other:
        others["bids-for-another-initiator"] = {"sender": stage.other}
    for name, changes in others.items():
        bid = yield from desk.asks(desk.call(**changes))
        stage.judge(name, bid, "no bid", bid)


def _judge_bid(stage: Stage, desk: Desk, call: CallForProposals, bid: Word, begin_us: int) -> None:
    if not desk.site.tells_offers:
        plans = [one for one in stage.since(Itinerary, begin_us) if one.message.grade is Grade.TENTATIVE]
        stage.judge("bid-tells-no-plan", not bid.message.itinerary_version and not plans, "a plan with it", bid, *plans)
    above_ms = desk.over_ms(call, bid) - desk.floor_over_ms()
    stage.judge("bid-is-not-below-the-floor", above_ms >= 0, f"{-above_ms} ms below", bid)
    if stage.lift:
        # Its delay is that of what it asks the lift (duty B11).
        return
    waited_us, owed_us = bid.time_us - begin_us, desk.delay_us(above_ms * MS)
    what = f"after {waited_us} us; its delay is {owed_us} us"
    stage.judge("bid-waits-its-delay", waited_us >= owed_us - 2 * MS, what, bid)
    stage.judge("bid-is-not-late", waited_us <= owed_us + stage.means.late_us, what, bid)
    is_near = abs(waited_us - owed_us) <= max(stage.means.late_us // 3, 2 * MS)
    stage.judge("bid-is-in-its-slot", is_near, what, bid)


BEATEN = (
    Check("beaten-by-1-ms", "B5", _COUNTS),
    Check("beaten-by-far", "B6", _NOTHING),
    Check("beats-by-1-ms", "B5", _COUNTS),
    Check("equal-cost-of-a-lower-node-wins", "B5", _COUNTS),
    Check("equal-cost-of-a-higher-node-loses", "B5", _COUNTS),
    Check("bid-far-below-the-floor-is-void", "B5", _COUNTS_NOT),
    Check("bid-a-little-below-the-floor-counts", "B5", "below the floor (FINISH_TIME: by more than `T_slack`)"),
    Check("bid-of-an-obstacle-is-void", "B5", _COUNTS_NOT),
    Check("bid-of-who-stopped-is-void", "J7", "Of an obstacle bids do not count"),
    Check("bid-of-who-is-left-out-is-void", "B5", _COUNTS_NOT),
    Check("bid-for-another-call-is-none", "B5", _COUNTS),
    Check("bid-of-a-stranger-is-void", "F2", "I hear only machines of the site file"),
    Check("bid-of-a-tool-is-void", "F2", "nodes 251 to 255 with what the DBC lets `Gateway` say"),
    Check(
        "bid-of-another-contract-is-void",
        "J8",
        ("Of a machine of another contract, site or epoch I take in nothing but its heartbeats and emergency stops."),
    ),
    Check(
        "bid-of-another-site-is-void",
        "J8",
        ("Of a machine of another contract, site or epoch I take in nothing but its heartbeats and emergency stops."),
    ),
    Check(
        "bid-of-another-epoch-is-void",
        "J8",
        ("Of a machine of another contract, site or epoch I take in nothing but its heartbeats and emergency stops."),
    ),
    Check("bid-counts-again-of-who-is-back", "J6", "It takes part again when none of this is so"),
)


def beaten(stage: Stage, cast: Cast) -> Play:
    """Others bid: better, as good, worse, and what does not count."""
    desk = Desk(stage, cast, 0x0200, 100)
    call = desk.call()
    own = yield from desk.asks(call)
    if own is None or not (yield from _waits(stage, desk)):
        return
    mine_ms, floor_ms, other = desk.over_ms(call, own), desk.floor_over_ms(), stage.other

    def against(name: str, sender: int, over_ms: int, *, bids: bool, number: int | None = None) -> Play:
        call = desk.call()
        cost = (call.deadline_ms + over_ms) % 2**32
        bid = yield from desk.asks(call, Bid(sender, call.sender, number or call.call, cost, 0))
        what = "no bid" if bids else "bids though it is beaten"
        stage.judge(name, (bid is not None) is bids, what, own, bid)

    yield from against("beaten-by-1-ms", other, mine_ms - 1, bids=False)
    yield from against("beaten-by-far", other, floor_ms, bids=False)
    yield from against("beats-by-1-ms", other, mine_ms + 1, bids=True)
    low, high = stage.caller, other
    if low < stage.node:
        yield from against("equal-cost-of-a-lower-node-wins", low, mine_ms, bids=False)
    if high > stage.node:
        yield from against("equal-cost-of-a-higher-node-loses", high, mine_ms, bids=True)
    yield from against("bid-far-below-the-floor-is-void", other, floor_ms - 600, bids=True)
    yield from against("bid-a-little-below-the-floor-counts", other, floor_ms - 400, bids=False)
    yield from against("bid-for-another-call-is-none", other, floor_ms, bids=True, number=0x0EEE)
    yield from against("bid-of-a-stranger-is-void", stage.stranger, floor_ms, bids=True)
    yield from against("bid-of-a-tool-is-void", 251, floor_ms, bids=True)
    part = cast.parts[other]
    for name, changes in (
        ("bid-of-an-obstacle-is-void", {"state": MachineState.OBSTACLE}),
        ("bid-of-who-stopped-is-void", {"state": MachineState.STOPPED}),
        ("bid-of-another-contract-is-void", {"contract": part.contract ^ 1}),
        ("bid-of-another-site-is-void", {"site_digest": part.site_digest ^ 1}),
        ("bid-of-another-epoch-is-void", {"epoch": 200}),
    ):
        before = {key: getattr(part, key) for key in changes}
        yield from _is_now(stage, cast, changes)
        yield from against(name, other, floor_ms, bids=True)
        yield from _is_now(stage, cast, before)
    yield from against("bid-counts-again-of-who-is-back", other, floor_ms, bids=False)
    call = desk.call()
    stage.say(LeftOut(call.sender, call.call, other, 0, 0, 0, 0, 0))
    cost = (call.deadline_ms + floor_ms) % 2**32
    bid = yield from desk.asks(call, Bid(other, call.sender, call.call, cost, 0))
    stage.judge("bid-of-who-is-left-out-is-void", bid, "no bid", bid)


def _is_now(stage: Stage, cast: Cast, changes: dict[str, Any]) -> Play:
    part = cast.parts[stage.other]
    for key, value in changes.items():
        setattr(part, key, value)
    cast.beat(part)
    # No duty says how soon it counts; ours look at the others once in a heartbeat period.
    yield from stage.pause(2.5)


#: Calls that are no task for a robot: what is otherwise in them.
_SILENT: dict[str, tuple[str, str, dict[str, Any]]] = {
    "silent-on-a-call-for-lifts": ("B1", _LOOKS, {"kind": KindCode.LIFT}),
    "silent-on-a-call-for-compartments": ("B1", _LOOKS, {"kind": KindCode.COMPARTMENT}),
    "silent-on-a-call-for-lathes": ("B1", _LOOKS, {"kind": KindCode.LATHE}),
    "silent-on-a-ride": ("B1", _LOOKS, {"operation": Operation.RIDE}),
    "silent-on-machining": ("B1", _LOOKS, {"operation": Operation.MACHINE}),
    "silent-on-a-price": ("B1", _LOOKS, {"criterion": Criterion.MONEY}),
    "silent-on-a-length": ("B1", _LOOKS, {"criterion": Criterion.LENGTH}),
    "silent-on-a-car-too-long": ("B6", _NOTHING, {"wheelbase_mm": 4_040}),
    "silent-on-a-car-too-short": ("B6", _NOTHING, {"wheelbase_mm": 1_520}),
    "silent-on-a-call-of-a-stranger": ("F2", "I hear only machines of the site file", {"sender": None}),
}
SILENT = (
    *(Check(name, duty, sentence) for name, (duty, sentence, _) in _SILENT.items()),
    Check("silent-where-too-late", "B1", "not within 2 `T_guard` of its deadline"),
    Check("silent-where-too-far", "B1", "nor with a deadline beyond `T_far_call`"),
    Check("silent-on-a-call-of-the-past", "B1", "that I can still answer"),
    Check("short-window-is-answered-in-time", "B6", "I say no bid from 2 `T_guard` before the deadline on."),
    Check(
        "newer-call-voids-the-older",
        "B1",
        (
            "A call with the number, or for the same task, operation, depth, part and "
            "parent of the same initiator as an older one, voids the older"
        ),
    ),
    Check("newer-call-is-bid-for", "B1", "voids the older"),
    Check("withdrawn-call-is-left", "B7", "when the call closes for another or nobody"),
)


def silent(stage: Stage, cast: Cast) -> Play:
    """Calls that are not for it, that it cannot answer, or that are over."""
    desk = Desk(stage, cast, 0x0300, 200)
    for name, (_, _, changes) in _SILENT.items():
        call = desk.call(**({"sender": stage.stranger} if "sender" in changes else changes))
        bid = yield from desk.asks(call)
        stage.judge(name, bid is None, "it bid", bid)
    bus_us = stage.bus_us
    for name, window_us in (
        ("silent-where-too-late", 30 * MS),
        ("silent-where-too-far", 70_000 * MS),
        ("silent-on-a-call-of-the-past", -500 * MS),
    ):
        bus_us = stage.bus_us
        bid = yield from desk.asks(desk.call(deadline_ms=stage.bus_ms(bus_us + window_us)))
        stage.judge(name, bid is None, "it bid", bid)
    begin_us, window_us = stage.now_us, 120 * MS
    bid = yield from desk.asks(desk.call(deadline_ms=stage.bus_ms(stage.bus_us + window_us)))
    limit_us = begin_us + window_us - 2 * stage.site.timing.deadline_guard_us
    stage.judge("short-window-is-answered-in-time", bid is None or bid.time_us <= limit_us, "too late", bid)
    if not (yield from _waits(stage, desk)):
        return
    begin_us = stage.now_us
    old = desk.call()
    stage.say(old)
    yield from stage.pause(0.005)
    new = desk.call(task=old.task, attempt=2)
    bid = yield from desk.asks(new)
    stage.judge("newer-call-is-bid-for", bid, "no bid", bid)
    late = desk.bid_of(old, begin_us)
    stage.judge("newer-call-voids-the-older", late is None, "bids for the older one", late)
    begin_us = stage.now_us
    gone = desk.call()
    stage.say(gone)
    yield from stage.pause(0.005)
    desk.withdraw(gone)
    yield from stage.pause(1.2)
    late = desk.bid_of(gone, begin_us)
    stage.judge("withdrawn-call-is-left", late is None, "bids though it is withdrawn", late)


def _waits(stage: Stage, desk: Desk) -> Generator[Wait, None, bool]:
    """Whether its bids wait long enough for a word between call and bid."""
    begin_us = stage.now_us
    bid = yield from desk.asks(desk.call())
    return bid is not None and bid.time_us - begin_us > _TIME_FOR_A_WORD_US


SETS = (
    Check("call-without-its-load-is-none", "F4", _SET),
    Check("call-without-its-terms-is-none", "F4", _SET),
    Check("half-a-call-is-counted", "F4", "After `T_set` without a frame of it a set is dropped."),
    Check("call-in-another-order-counts", "F4", ("A set counts when it is whole, in whatever order its frames come")),
    Check("call-with-a-doubled-frame-counts", "F4", "A set counts when it is whole"),
    Check(
        "call-with-two-contents-is-none",
        "F4",
        ("A frame that differs from that of the same place in an open set ends that set."),
    ),
    Check("call-of-two-senders-is-none", "F4", "with one sender and one `call`"),
    Check("call-of-two-numbers-is-none", "F4", "with one sender and one `call`"),
    Check("call-after-its-time-is-none", "F4", "After `T_set` without a frame of it a set is dropped."),
    Check("call-twice-is-one", "B5", "So the bids of one call strictly improve on the bus."),
    Check("call-twice-waits-once", "B4", "I bid when my delay since I heard the call is over"),
)


def sets(stage: Stage, cast: Cast) -> Play:
    """Calls of three frames that do not come as they should."""
    desk = Desk(stage, cast, 0x0400, 300)

    def after(name: str, call: CallForProposals, *, bids: bool) -> Play:
        begin_us = stage.now_us
        yield from stage.pause(1.1)
        bid = desk.bid_of(call, begin_us)
        stage.judge(name, (bid is not None) is bids, "no bid" if bids else "it bid", bid)
        desk.withdraw(call)
        yield from stage.pause(0.3)

    call = desk.call()
    head, terms, load = stage.codec.encode(call)
    before = stage.count_of(Reason.INCOMPLETE_SET)
    stage.put(head, terms)
    yield from after("call-without-its-load-is-none", call, bids=False)
    call = desk.call()
    head, terms, load = stage.codec.encode(call)
    stage.put(head, load)
    yield from after("call-without-its-terms-is-none", call, bids=False)
    call = desk.call()
    head, terms, load = stage.codec.encode(call)
    stage.put(load, head, terms)
    yield from after("call-in-another-order-counts", call, bids=True)
    call = desk.call()
    head, terms, load = stage.codec.encode(call)
    stage.put(head, terms, terms, load)
    yield from after("call-with-a-doubled-frame-counts", call, bids=True)
    call = desk.call()
    head, terms, load = stage.codec.encode(call)
    other = stage.codec.encode(desk.call(call=call.call, from_station=desk.bay.number + 1))[1]
    stage.put(head, other, terms, load)
    yield from after("call-with-two-contents-is-none", call, bids=False)
    yield from _mixed(stage, desk, after)
    yield from _late_or_twice(stage, desk, after, before)


#: Judges whether a call is bid for.
_After = Callable[..., Play]


def _mixed(stage: Stage, desk: Desk, after: _After) -> Play:
    if stage.other:
        call = desk.call()
        head, terms, load = stage.codec.encode(call)
        stage.put(head, terms._replace(arbitration_id=terms.arbitration_id & ~0xFF | stage.other), load)
        yield from after("call-of-two-senders-is-none", call, bids=False)
    call, wrong = desk.call(), desk.call()
    stage.put(stage.codec.encode(call)[0], *stage.codec.encode(wrong)[1:])
    yield from after("call-of-two-numbers-is-none", call, bids=False)


def _late_or_twice(stage: Stage, desk: Desk, after: _After, before: int) -> Play:
    call = desk.call(deadline_ms=stage.bus_ms(stage.bus_us + 3_000 * MS))
    head, terms, load = stage.codec.encode(call)
    stage.put(head, terms)
    yield from stage.pause(1.2)
    stage.put(load)
    yield from after("call-after-its-time-is-none", call, bids=False)
    begin_us = stage.now_us
    call = desk.call()
    stage.say(call)
    # Before its delay is over, and long enough to be seen in the bid.
    yield from stage.pause(_AGAIN_S)
    stage.say(call)
    yield from stage.pause(1.2 - _AGAIN_S)
    mine = [one for one in stage.since(Bid, begin_us) if one.message.call == call.call]
    stage.judge("call-twice-is-one", len(mine) == 1, f"{len(mine)} bids", *mine)
    above_us = (desk.over_ms(call, mine[0]) - desk.floor_over_ms()) * 1000 if mine else 0
    limit_us = begin_us + desk.delay_us(above_us) + stage.means.late_us
    if not stage.lift:
        stage.judge("call-twice-waits-once", mine and mine[0].time_us <= limit_us, "waits since the second", *mine)
    desk.withdraw(call)
    yield from stage.pause(2.5)
    told = [one for one in stage.since(Diagnostic, 0) if one.message.reason is Reason.INCOMPLETE_SET]
    stage.judge("half-a-call-is-counted", told and told[-1].message.count != before, "not counted", *told[-1:])


TIME = (
    Check(
        "no-bid-without-time",
        "T5",
        ("A clock that heard no `BusTime` for `T_lost` is lost; a machine whose clock is lost bids for nothing"),
    ),
    Check("bids-when-time-is-back", "T5", ("a machine whose clock is lost bids for nothing and opens no call.")),
    Check("bids-where-time-is-a-little-off", "T2", "each later one corrects it by at most `T_slew`."),
    Check(
        "far-time-loses-the-clock",
        "T3",
        ("One that is off by more than `T_far` corrects nothing: my clock counts as lost."),
    ),
    Check("right-time-heals-the-clock", "T3", "One that is off by more than `T_far` corrects nothing"),
    Check("time-of-a-stranger-is-none", "F2", "I hear only machines of the site file"),
    Check("time-of-a-tool-is-none", "F2", "nodes 251 to 255 with what the DBC lets `Gateway` say"),
)


def time(stage: Stage, cast: Cast) -> Play:
    """Bus time stays away, comes back, and is wrong."""
    desk = Desk(stage, cast, 0x0500, 400)
    for name, sender in (("time-of-a-stranger-is-none", stage.stranger), ("time-of-a-tool-is-none", 251)):
        stage.say(BusTime(sender, stage.bus_us + 50_000_000))
        yield from stage.pause(0.1)
        bid = yield from desk.asks(desk.call())
        stage.judge(name, bid, "no bid: it was taken up", bid)
    cast.gives_time = False
    yield from stage.pause(21.5)
    bid = yield from desk.asks(desk.call())
    stage.judge("no-bid-without-time", bid is None, "it bid", bid)
    yield from _gives(stage, cast, 0)
    bid = yield from desk.asks(desk.call())
    stage.judge("bids-when-time-is-back", bid, "no bid", bid)
    yield from _gives(stage, cast, 40 * MS)
    bid = yield from desk.asks(desk.call())
    stage.judge("bids-where-time-is-a-little-off", bid, "no bid", bid)
    yield from _gives(stage, cast, 500 * MS)
    bid = yield from desk.asks(desk.call())
    stage.judge("far-time-loses-the-clock", bid is None, "it bid", bid)
    yield from _gives(stage, cast, 0)
    bid = yield from desk.asks(desk.call())
    stage.judge("right-time-heals-the-clock", bid, "no bid", bid)


def _gives(stage: Stage, cast: Cast, error_us: int) -> Play:
    """One word of bus time that is so far off."""
    cast.gives_time, cast.time_error_us, cast.time_due_us = True, error_us, stage.now_us
    yield from stage.pause(0.3)
    cast.time_error_us = 0


SCENES = (
    Scene("bids", BIDS, bids),
    Scene("others bid", BEATEN, beaten, needs_other=True),
    Scene("no task for it", SILENT, silent),
    Scene("sets of frames", SETS, sets),
    Scene("time", TIME, time),
)

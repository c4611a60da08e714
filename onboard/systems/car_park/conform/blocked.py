"""Segments that cannot be passed: duty P12 of docs/protocol.md, seen in digests and bids."""

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import OPERATOR, Play, Stage
from onboard.contract.codes import Reason
from onboard.contract.messages import Blocked, Clear, Heartbeat, Message
from onboard.systems.car_park.conform.desk import Desk

_BLOCKED = "A segment of which `Blocked` was heard, from a gateway or its steward, is in nobody's way until `Clear`."
_STEWARD = "nor `Blocked` and `Clear` of a machine that is not the track's steward."

BLOCKED = (
    Check("block-of-an-operator-counts", "P12", _BLOCKED),
    Check("block-of-the-steward-counts", "P12", _BLOCKED),
    Check("block-is-in-the-digest", "J4", "then `1 << 31 | track << 8 | index` of each blocked segment, in order."),
    Check("block-of-who-is-no-steward-is-none", "F2", _STEWARD),
    Check("clear-of-who-is-no-steward-is-none", "F2", _STEWARD),
    Check("silent-where-the-bay-is-blocked", "B6", "Who cannot do the task, or not better, says nothing."),
    Check("clear-ends-a-block", "P12", _BLOCKED),
    Check("bids-when-the-bay-is-free", "P12", _BLOCKED),
)


def blocked(stage: Stage, cast: Cast) -> Play:
    """The front of the bay is blocked, and cleared, by who may and who may not."""
    desk = Desk(stage, cast, 0x0D00, 1_200)
    desk.place_car()
    track, front = desk.bay.track, desk.bay.segment

    def said(name: str, message: Message) -> Play:
        stage.say(message)
        begin_us = stage.now_us
        beat = yield from stage.hears(Heartbeat, lambda one: one.mirror_digest == cast.digest(), 5.0)
        told = stage.since(Heartbeat, begin_us)
        stage.judge(name, beat, f"never told the digest {cast.digest():04X}", *told)

    yield from said("block-of-who-is-no-steward-is-none", Blocked(stage.other, track, 2, Reason.OPERATOR))
    cast.blocked.add(front.number)
    yield from said("block-of-an-operator-counts", Blocked(OPERATOR, track, front.index, Reason.OPERATOR))
    bid = yield from desk.asks(desk.call())
    stage.judge("silent-where-the-bay-is-blocked", bid is None, "it bid", bid)
    yield from said("clear-of-who-is-no-steward-is-none", Clear(stage.other, track, front.index, Reason.NONE))
    steward = desk.site.stewards[track]
    cast.blocked.add(track << 8 | 1)
    yield from said("block-of-the-steward-counts", Blocked(steward, track, 1, Reason.OPERATOR))
    beat = stage.last(Heartbeat)
    stage.judge("block-is-in-the-digest", beat and beat.message.mirror_digest == cast.digest(), "another", beat)
    cast.blocked.clear()
    stage.say(Clear(OPERATOR, track, 1, Reason.NONE))
    yield from said("clear-ends-a-block", Clear(OPERATOR, track, front.index, Reason.NONE))
    bid = yield from desk.asks(desk.call())
    stage.judge("bids-when-the-bay-is-free", bid, "no bid", bid)


SCENES = (Scene("blocked segments", BLOCKED, blocked, needs_other=True),)

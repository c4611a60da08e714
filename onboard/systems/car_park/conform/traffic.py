"""Another robot drives slower than it could, elsewhere, and is not heard: duties P1, P4, P8 of docs/protocol.md."""

from dataclasses import replace

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import Play, Stage
from onboard.contract.codes import Grade, MachineState
from onboard.contract.messages import Heartbeat, Itinerary, Progress, TokenRequest
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.conform.rival import Rival, meeting

_SLOW = "where a leg is longer than its run, from the earliest to the latest that fit."
_STAYS = "Where two plans had agreed who passes a segment first, that order stays whatever is late"


def _spurs(desk: Desk) -> list[int]:
    return [one.number for one in desk.site.tracks.values() if one.low is not None]


SLOW = (
    Check("bids-beside-a-slow-leg", "B1", "that I can still answer"),
    Check("plan-leaves-a-slow-legs-windows", "P4", _SLOW),
    Check("bid-keeps-clear-of-a-slow-leg", "B2", "What it promises it keeps as well as it can"),
    Check("plan-leaves-a-plan-that-leads-elsewhere", "P8", _STAYS),
    Check(
        "request-names-who-leads-elsewhere", "K9", "`predecessor` who passes right before me by the plans that I know"
    ),
)


_COUNTS = "silent for `T_silent` the next plan counts whatever its version"
SILENT = (Check("plan-of-who-was-silent-counts", "P1", _COUNTS),)


def silent(stage: Stage, cast: Cast) -> Play:
    """Another robot is not heard for a while, and makes more plans meanwhile than their versions tell apart."""
    rival = Rival(stage, cast, Desk(stage, cast, 0x1F00, 2_500))
    rival.stands()
    yield from stage.pause(3.0)
    part, plan = cast.parts[rival.node], rival.plan
    part.is_there = part.answers = False
    yield from stage.pause(9.0)
    cast.plans[rival.node] = replace(plan, version=(plan.version + 199) % 255 + 1)
    part.is_there = part.answers = True
    cast.beat(part)
    stage.say(rival.plan)
    right = cast.digest()
    beat = yield from stage.hears(Heartbeat, lambda one: one.mirror_digest == right, 5.0)
    stage.judge("plan-of-who-was-silent-counts", beat, f"never told the digest {right:04X}", stage.last(Heartbeat))
    rival.stands()
    yield from stage.pause(5.0)


def slow(stage: Stage, cast: Cast) -> Play:
    """Another robot takes far longer for a run than it must; then its plan leads elsewhere behind that."""
    desk = Desk(stage, cast, 0x1A00, 2_500)
    desk.place_car()
    rival = Rival(stage, cast, desk)
    far = _beyond(desk, rival)
    rival.way((far, 5.0), slower_s=40.0).into(rival.home.track).tell()
    stamp = rival.plan.stamp
    yield from rival.drives(0.5)
    call, bid = yield from desk.wins()
    stage.judge("bids-beside-a-slow-leg", bid, "no bid", bid)
    begin_us = stage.now_us
    plan = yield from stage.hears(Itinerary, lambda one: one.grade is Grade.FIRM, 3.0, begin_us)
    if bid is not None and plan is not None:
        meets = meeting(desk, plan.message, rival.plan, way_back=False)
        stage.judge("plan-leaves-a-slow-legs-windows", meets is None, f"{meets}", plan)
        late_ms = max((stage.unrolled_ms(leg.end_ms) for leg in plan.message.legs[-2:-1]), default=0)
        is_behind = late_ms >= stage.unrolled_ms(rival.plan.legs[1].end_ms)
        stage.judge("bid-keeps-clear-of-a-slow-leg", is_behind, "is over before the other has passed", bid, plan)
        yield from rival.drives(3.0)
        free = next(one for one in _spurs(desk) if one not in (rival.home.track, _track(stage)))
        rival.way((far, 25.0), slower_s=40.0).into(free).tell(stamp)
        yield from rival.drives(4.0)
        last = next(one for one in reversed(stage.words[Itinerary]) if one.message.grade is Grade.FIRM)
        meets = meeting(desk, last.message, rival.plan, stage.bus_us // 1000, way_back=False)
        stage.judge("plan-leaves-a-plan-that-leads-elsewhere", meets is None, f"{meets}", last)
        yield from rival.drives(90.0)
        asked = [one for one in stage.since(TokenRequest, begin_us) if one.message.predecessor]
        stage.judge("request-names-who-leads-elsewhere", asked, "names nobody", last)
    desk.withdraw(call)
    rival.stands()
    yield from stage.pause(5.0)
    yield from stage.hears(Heartbeat, lambda one: one.state is MachineState.IDLE, 120.0)
    yield from stage.pause(30.0)


def _beyond(desk: Desk, rival: Rival) -> int:
    """The end of the alley that is beyond the bay, seen from where the other rests."""
    is_low = desk.segment_at(rival.home.track, 0).index > desk.bay.index
    return 1 if is_low else desk.site.tracks[desk.bay.track].length


def _track(stage: Stage) -> int:
    place = stage.last(Progress)
    return 0 if place is None else int(place.message.track)


SCENES = (
    Scene("a slow robot", SLOW, slow, needs_car=True, needs_rival=True),
    Scene("a robot that was silent", SILENT, silent, needs_rival=True),
)

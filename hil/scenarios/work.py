"""Scenarios of ordinary work: the device joins, bids, wins, moves under authority, and gives way."""

from hil.stage import TestBench
from onboard.contract.codes import (
    CONTRACT_VERSION,
    CallResult,
    DriveMode,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Side,
    TaskPhase,
    TokenKind,
)
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    DriveState,
    Heartbeat,
    Itinerary,
    Leg,
    Message,
    Progress,
    Reference,
    Stamp,
    TaskReport,
    TokenHeld,
)
from onboard.core.site import Machine
from onboard.ways.site import TrackKind, way_site

#: From power to taking part, s; a board may boot for a while.
JOIN_S = 60.0
#: From a car's coming to a call, and from a call to its award, s: far beyond what any site file asks for.
CALL_S = AWARD_S = 20.0
#: From an award to motion, s: a lift may have to come first.
MOTION_S = 30.0
#: Each leg of the plan that the bench tells takes so long, ms.
LEG_MS = 8_000


async def joins(stage: TestBench) -> None:
    """The first heartbeat tells contract, site and kind; then all mirrors agree and the device is ready to work."""
    await stage.power_on()
    first = (await stage.first_own(Heartbeat, "heartbeat of the device", JOIN_S)).message
    heard = (first.contract, first.site_digest, first.kind)
    assert heard == (CONTRACT_VERSION, stage.site.digest, stage.machine.kind), f"the first heartbeat tells {heard}"
    await stage.takes_part(JOIN_S)


async def bids(stage: TestBench) -> Reference:
    """A car or an order comes, and the device bids in time; the task that is called for."""
    await stage.power_on()
    await stage.takes_part(JOIN_S)
    since = stage.mark()
    stage.bring()
    task = (await stage.first(CallForProposals, "call", CALL_S, _is_outer, since)).message.task
    calls: dict[int, int] = {}

    def answers(bid: Bid) -> bool:
        # A call without a bid is opened again, under another number.
        heard = stage.heard(CallForProposals, since)
        calls.update({one.message.call: one.time_us for one in heard if one.message.task == task})
        return bid.call in calls

    bid = await stage.first_own(Bid, "bid", AWARD_S, answers, since)
    late_us = bid.time_us - calls[bid.message.call] - stage.site.timing.call_window_us
    assert late_us < 0, f"the bid came {late_us / 1e6:.3f} s after the deadline"
    return task


async def is_awarded(stage: TestBench, task: Reference) -> None:
    """The device, which has no rival, is awarded a task, at the first call for it or at a later one."""
    award = await stage.first(
        Award, "award", AWARD_S, lambda one: one.task == task and one.result is CallResult.AWARDED
    )
    assert award.message.winner == stage.machine.node_id, f"node {award.message.winner} has won"


async def takes(stage: TestBench) -> None:
    """With no rival the device is awarded the task, and reports it as its own."""
    task = await bids(stage)
    await is_awarded(stage, task)
    await stage.first_own(TaskReport, "report", MOTION_S, lambda one: one.task == task)


async def wins(stage: TestBench) -> None:
    """With no rival the device is awarded the task, tells a firm plan and reports the task as its own."""
    task = await bids(stage)
    await is_awarded(stage, task)
    await stage.first_own(Itinerary, "firm plan", MOTION_S, _is_firm_journey)
    await stage.first_own(
        TaskReport, "report", MOTION_S, lambda one: (one.task, one.phase) == (task, TaskPhase.AWARDED)
    )


async def moves(stage: TestBench) -> None:
    """The device holds a token, then drives off its home; the judge looks at every step."""
    home = stage.machine.home
    await wins(stage)
    where = await stage.first_own(
        Progress, "progress off the home segment", MOTION_S, lambda one: (one.track, one.index) != home
    )
    held = [one.time_us for one in stage.own(TokenHeld) if one.message.token_kind is TokenKind.SEGMENT]
    assert held and held[0] <= where.time_us, (
        f"it moved at {where.time_us / 1e6:.3f} s and said of no token that it has it"
    )


async def yields(stage: TestBench) -> None:
    """Another robot's firm plan leads through where the device stands idle: it leaves, and nobody collides.

    The bench speaks for the other robot, which nobody runs here, so that the plan surely leads there.
    """
    other, home = _another_robot(stage), stage.machine.home
    await stage.power_on()
    own = await stage.takes_part(JOIN_S)
    since = stage.mark()
    _tell_plan_through(stage, other, own)
    await stage.first_own(Itinerary, "firm plan that leads away", MOTION_S, _is_firm_journey, since)
    await stage.first_own(
        Progress, "progress off the home segment", MOTION_S, lambda one: (one.track, one.index) != home, since
    )
    await stage.first_own(DriveState, "stand", MOTION_S, lambda one: one.mode is DriveMode.STANDING, stage.mark())


def _is_outer(call: CallForProposals) -> bool:
    return call.depth == 0


def _is_firm_journey(plan: Itinerary) -> bool:
    return plan.grade is Grade.FIRM and any(leg.action is not LegAction.STAND for leg in plan.legs)


def _another_robot(stage: TestBench) -> Machine:
    others = [
        one
        for one in stage.site.machines.values()
        if one.kind is KindCode.ROBOT and one.node_id != stage.machine.node_id
    ]
    assert others, f"site {stage.site.name} has one robot only: name a site with two"
    return others[0]


def _tell_plan_through(stage: TestBench, other: Machine, own: Heartbeat) -> None:
    """What the other robot would say: that it lives, where it stands, and that it works one segment behind the device.

    It comes back to where it was, so that the end of the alley is free for whoever gives way.
    """
    home, mine, node = other.home, stage.machine.home, other.node_id
    now_ms = stage.bus_time_ms()
    lift = next(one.number for one in way_site(stage.site).tracks.values() if one.kind is TrackKind.LIFT)
    steps = (
        (LegAction.TRAVEL, home.track, home.index, 0),
        (LegAction.RIDE, lift, home.track, mine.track),
        (LegAction.TRAVEL, mine.track, 0, mine.index + 1),
        (LegAction.WORK, mine.track, mine.index + 1, mine.index + 1),
        (LegAction.TRAVEL, mine.track, mine.index + 1, 0),
        (LegAction.RIDE, lift, mine.track, home.track),
        (LegAction.TRAVEL, home.track, 0, home.index),
    )
    legs = tuple(
        Leg(action, track, first, last, Side.NEAR, now_ms + LEG_MS * number)
        for number, (action, track, first, last) in enumerate(steps, start=1)
    )
    said: tuple[Message, ...] = (
        Heartbeat(node, CONTRACT_VERSION, stage.site.digest, own.mirror_digest, 1, other.kind, MachineState.WORKING),
        Progress(node, 0, 0, home.track, home.index, 0, 0),
        Itinerary(node, 2, Grade.FIRM, Stamp(now_ms, 1, 1), legs),
    )
    for message in said:
        stage.say(message)

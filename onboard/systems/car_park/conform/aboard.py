"""Power cuts on a lift's platform: chapters 9 and 12 of docs/protocol.md, with a ride in hand."""

from functools import partial

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import Play, Stage, Word
from onboard.contract.codes import MachineState, TaskPhase
from onboard.contract.constants import ACTING
from onboard.contract.messages import CallForProposals, Heartbeat, Progress, TaskReport
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.conform.platforms import Phase, Platform, platform_of
from onboard.systems.car_park.conform.rides import car_below

_PLACE = "A robot's place comes from its sensors, what is in hand from the journal."
_HAS = "An award for me that is heard again is answered with how the task stands"
_BACK = "A robot gives the gate back when it is wholly aboard or wholly out, the platform when it is out."
#: Moments at which the power is cut, and what they are called in checks.
_MOMENTS = {"aboard": Phase.BOARDING, "on-the-ride": Phase.RIDING, "at-its-stop": Phase.LEAVING}


def _of_moment(name: str) -> tuple[Check, ...]:
    return (
        Check(f"cut-{name}-is-on-the-platform", "R10", _PLACE),
        Check(f"cut-{name}-takes-part-again", "J9", "its next heartbeat says that it takes part."),
        Check(f"cut-{name}-has-its-task", "U3", _HAS),
        Check(f"cut-{name}-rides-on", "R10", _PLACE),
        Check(f"cut-{name}-gives-both-back", "L5", _BACK),
    )


ABOARD = tuple(check for name in _MOMENTS for check in _of_moment(name))


def aboard(stage: Stage, cast: Cast) -> Play:
    """The node is on its way to the car below, and its power is cut on the platform; three times."""
    desk, lift = Desk(stage, cast, 0x1E00, 3_100), platform_of(cast)
    for name, phase in _MOMENTS.items():
        yield from car_below(stage, cast, desk)
        call, bid = yield from desk.wins()
        if bid is None:
            continue
        yield from stage.until(partial(_is_in, stage, lift, phase), 90.0)
        if _is_in(stage, lift, phase):
            yield from _cut(stage, lift, desk, call, name)
        lift.reset()
        desk.withdraw(call)
        yield from stage.pause(10.0)
        yield from stage.hears(Heartbeat, lambda one: one.state is MachineState.IDLE, 120.0)


def _is_in(stage: Stage, lift: Platform, phase: Phase) -> bool:
    """The moment: it stands on the platform, the lift drives, or has let it out."""
    place = stage.last(Progress)
    is_on = place is not None and lift.is_on(place.message)
    return is_on and lift.phase is phase and (phase is Phase.RIDING or lift.has(lift.gate_key))


def _cut(stage: Stage, lift: Platform, desk: Desk, call: CallForProposals, name: str) -> Play:
    stage.switch(on=False)
    yield from stage.pause(1.0)
    begin_us = stage.now_us
    stage.switch(on=True)
    place = yield from stage.hears(Progress, within_s=15.0, since_us=begin_us)
    is_on = place is not None and lift.is_on(place.message)
    stage.judge(f"cut-{name}-is-on-the-platform", is_on, "another place, or none", place)
    acts = yield from stage.hears(Heartbeat, lambda one: one.state in ACTING, 15.0, begin_us)
    stage.judge(f"cut-{name}-takes-part-again", acts, "says no state of one who takes part", acts)
    again_us = stage.now_us
    desk.award(call, stage.node)
    answer: Word | None = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 3.0, again_us)
    has_it = answer is not None and answer.message.phase in (TaskPhase.AWARDED, TaskPhase.STARTED)
    stage.judge(f"cut-{name}-has-its-task", has_it, "not answered AWARDED", answer)

    def is_off(one: Progress) -> bool:
        return not lift.is_on(one)

    off = yield from stage.hears(Progress, is_off, 60.0, begin_us)
    stage.judge(f"cut-{name}-rides-on", off and off.message.track == desk.bay.track, "not below within 60 s", off)
    free = yield from stage.until(lambda: lift.phase is Phase.FREE, 20.0)
    stage.judge(f"cut-{name}-gives-both-back", free, "platform or gate still away after 20 s", off)


SCENES = (Scene("power cuts on a lift", ABOARD, aboard, needs_power=True, needs_car=True, needs_lift=True),)

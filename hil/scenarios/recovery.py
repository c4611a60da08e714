"""Scenarios of trouble that a machine must survive: a reset on the way, bus-off, a plug that is pulled."""

from hil.scenarios.work import JOIN_S, MOTION_S, moves
from hil.stage import TestBench
from onboard.contract.codes import DriveMode
from onboard.contract.messages import DriveState, Heartbeat
from onboard.core.mirror import MISSED_HEARTBEATS

#: The fleet's heartbeats, s: many times the longest period that a site may have would be an hour.
BEATS_S = 60.0


async def survives_reset(stage: TestBench) -> None:
    """Its power is cut while it drives: it brakes, comes back under the next boot counter, and goes on."""
    await moves(stage)
    before = stage.own(Heartbeat)[-1].message.boot
    await stage.device.power_off()
    since = stage.mark()
    await stage.first_own(
        DriveState, "stand, by the drive itself", MOTION_S, lambda one: one.mode is DriveMode.STANDING, since
    )
    await stage.power_on()
    beat = await stage.first_own(Heartbeat, "heartbeat after the reset", JOIN_S, since=stage.mark())
    assert beat.message.boot == before % 255 + 1, f"boot counter {beat.message.boot} after {before}: journal lost?"
    await stage.first_own(
        DriveState,
        "motion after the reset",
        MOTION_S + JOIN_S,
        lambda one: one.mode is DriveMode.MOVING,
        stage.mark(),
    )


async def leaves_bus_off(stage: TestBench) -> None:
    """Its frames are destroyed until it is off the bus: it comes back by itself, in the same life."""
    await stage.power_on()
    boot = (await stage.takes_part(JOIN_S)).boot
    await stage.device.force_bus_off()
    beat = await stage.takes_part(JOIN_S)
    assert beat.boot == boot, f"boot counter {beat.boot} after {boot}: it was started again"


async def survives_unplugging(stage: TestBench) -> None:
    """Its plug is pulled until the others take it for silent, and put back: it takes part again, in the same life."""
    await stage.power_on()
    boot = (await stage.takes_part(JOIN_S)).boot
    await stage.device.unplug()
    since = stage.mark()
    await stage.beats(min(stage.simulation.controllers), MISSED_HEARTBEATS + 1, BEATS_S)
    assert not stage.own(Heartbeat, since), "it was heard with its plug pulled: is the cable command the right one?"
    await stage.device.plug()
    beat = await stage.takes_part(JOIN_S)
    assert beat.boot == boot, f"boot counter {beat.boot} after {boot}: it was started again"

"""Scenarios of what must not happen to a fleet and does: a node-ID twice, another site's file, a flood."""

import re
from dataclasses import replace

from hil.scenarios.recovery import BEATS_S
from hil.scenarios.work import AWARD_S, CALL_S, JOIN_S, is_awarded
from hil.stage import BenchMessage, TestBench
from onboard.contract.codes import DriveMode, MachineState, Reason
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    Diagnostic,
    DriveState,
    Halted,
    Heartbeat,
    Message,
)
from onboard.core.frame import Frame

#: Frames of a flood: three quarters of a second of a full bus at 500 kbit/s, of eight bytes each.
FLOOD_FRAMES = 2_400
#: How many of them wait in the bench's own queue.
_FLOOD_WINDOW = 16
#: Of the most urgent message type but one that nobody knows, from node 253: wins every arbitration.
FLOOD_ID = 0x00FF_00FD


#: What a machine says that holds: who it is, why, what it dropped; and the time, if all others go by it.
_OF_WHO_HOLDS = Heartbeat | Halted | Diagnostic | BusTime


async def refuses_duplicate_node_id(stage: TestBench) -> None:
    """Another node speaks under its node-ID: it holds, and says so in each beat and on its console; it does no more."""
    await stage.power_on()
    own = await stage.takes_part(JOIN_S)
    # Not the very same frame, which would be acknowledged as one where both are sent at once.
    stage.say(replace(own, boot=own.boot % 255 + 1))
    await stage.first_own(Halted, "word that it holds", JOIN_S, lambda one: one.reason is Reason.DUPLICATE_NODE_ID)
    since = stage.mark()
    await stage.beats(min(stage.simulation.controllers), 1, BEATS_S)
    acts = [one for one in stage.own(Message, since) if not isinstance(one.message, _OF_WHO_HOLDS)]
    assert not acts, f"it still acts: {acts[0].message}"
    said = await stage.device.console()
    assert "held: DUPLICATE_NODE_ID" in said, f"its console does not tell why: {said[-300:]!r}"


async def refuses_wrong_site(stage: TestBench) -> None:
    """With another site's file it joins as an obstacle: it neither bids nor moves, and the others tell why."""
    await stage.device.power_on(wrong_site(stage.site_text))
    beat = await stage.first_own(Heartbeat, "heartbeat of the device", JOIN_S)
    assert beat.message.site_digest != stage.site.digest, "it has the right site file: were the files put there?"
    await stage.first(Diagnostic, "word of another site", JOIN_S, lambda one: one.reason is Reason.OTHER_SITE)
    await stage.first_own(
        Heartbeat, "word that it is an obstacle", JOIN_S, lambda one: one.state is MachineState.OBSTACLE
    )
    since = stage.mark()
    stage.bring()
    call = await stage.first(CallForProposals, "call", CALL_S, lambda one: one.depth == 0, since)
    await stage.first(Award, "end of the call", AWARD_S, lambda one: one.call == call.message.call, since)
    assert not stage.own(Bid, since), "it has bid for a task of a site that it does not know"
    moved = [one for one in stage.said[since:] if _is_motion(one, stage.machine.node_id)]
    assert not moved, f"it has moved: {moved[0].message}"


async def survives_flood(stage: TestBench) -> None:
    """A babbling node takes the whole bus: afterwards it takes part in the same life, and wins as ever."""
    await stage.power_on()
    boot = (await stage.takes_part(JOIN_S)).boot
    await _flood(stage)
    beat = await stage.takes_part(JOIN_S)
    assert beat.boot == boot, f"boot counter {beat.boot} after {boot}: it was started again"
    since = stage.mark()
    stage.bring()
    call = await stage.first(CallForProposals, "call", CALL_S, lambda one: one.depth == 0, since)
    await is_awarded(stage, call.message.task)


def wrong_site(text: str) -> str:
    """A site file of another name: another digest, the same machines."""
    changed, count = re.subn(r'^name\s*=\s*"(\w)', r'name = "not-\1', text, count=1, flags=re.MULTILINE)
    assert count == 1, "the first name in the site file of a bench is the site's"
    return changed


def _is_motion(one: BenchMessage[Message], node_id: int) -> bool:
    message = one.message
    return isinstance(message, DriveState) and message.sender == node_id and message.mode is not DriveMode.STANDING


async def _flood(stage: TestBench) -> None:
    """Frames as fast as the bus takes them: one more is queued for each that has left."""
    frame, left, gone = Frame(FLOOD_ID, b"\xff" * 8), [FLOOD_FRAMES], [0]

    def offer() -> None:
        if left[0] > 0:
            left[0] -= 1
            stage.node.send(frame)

    def on_sent(sent: Frame, _time_us: int) -> None:
        if sent == frame:
            gone[0] += 1
            offer()

    stage.node.subscribe(lambda _frame, _time_us: None, on_sent)
    for _ in range(_FLOOD_WINDOW):
        offer()
    await stage.until(lambda: gone[0] >= FLOOD_FRAMES or None, "end of the flood", BEATS_S)

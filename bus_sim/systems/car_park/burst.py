"""Everybody says at one instant all that the bounds allow for, and of what has a budget more than it: the worst case.

No machine is at work: programs that behave never say so much. The frames go through the queues of real controllers.
"""

import asyncio

from bus_sim.can.medium import Medium
from bus_sim.can.node import SimulatedBus
from bus_sim.systems.car_park.meter import Meter
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.base import Message, Stamp
from onboard.contract.codes import Grade, KindCode, LegAction, MachineState, Reason, Side, TokenKind
from onboard.contract.messages import Diagnostic, Heartbeat, Itinerary, Leg, TokenRequest
from onboard.controller.outgoing import Outgoing
from onboard.core.frame import Frame
from onboard.core.site import Machine, Site
from onboard.systems.car_park.traffic import MOST_LEGS, numbers_of, operation
from onboard.trace.response import ANYBODY, Stream
from onboard.wire.codec import fleet_codec
from onboard.wire.pace import paces_of

#: When it begins, us; nothing is waiting before.
BEGIN_US = 20_000_000
#: What has a budget is said again so often, so far apart, us.
_TIMES, _APART_US = 5, 300_000
#: The longest data there is: alternating runs of five bits make the most stuff bits.
_LONG = bytes([0b11111000, 0b00111110, 0b00001111, 0b10000011, 0b11100000, 0b11111000, 0b00111110, 0b00001111])


def burst(site: Site) -> Meter:
    """Play it until all is said."""
    loop = VirtualTimeLoop()
    return run_on(loop, _play(site, loop))


async def _play(site: Site, loop: VirtualTimeLoop) -> Meter:
    fleet = Medium(loop, bit_rate=site.bitrate)
    meter = Meter()
    meter.watch(fleet)
    nodes = {node: fleet.attach(machine.name, node) for node, machine in site.machines.items()}
    queues = {node: Outgoing(fleet_codec(), paces_of(site), bus.send) for node, bus in nodes.items()}
    for node, queue in queues.items():
        meter.listen(nodes[node].name, queue)
    paced, rights = paces_of(site), numbers_of(site).rights
    await asyncio.sleep(BEGIN_US / 1e6)
    for stream in operation(site):
        if stream.name not in paced:
            _say_all(stream, nodes, meter, loop.now_us())
    for time in range(_TIMES):
        for node, machine in site.machines.items():
            for message in _words(machine, rights, time):
                queues[node].say(message, loop.now_us())
        await _let_go(queues, loop, loop.now_us() + _APART_US)
    await _let_go(queues, loop, None)
    await asyncio.sleep(60.0)
    return meter


def _say_all(stream: Stream, nodes: dict[int, SimulatedBus], meter: Meter, now_us: int) -> None:
    """All that may be queued at once, by the least urgent machine where any may send it."""
    node = max(nodes) if stream.node == ANYBODY else stream.node
    frame = Frame(stream.priority & ~0xFF | node, _LONG)
    for _ in range(stream.burst * -(-(1 + stream.jitter_us) // stream.period_us)):
        meter.on_said(nodes[node].name, frame, now_us)
        nodes[node].send(frame)


async def _let_go(queues: dict[int, Outgoing], loop: VirtualTimeLoop, until_us: int | None) -> None:
    """As controllers do: each queue is asked when it wishes, up to a time or until nothing waits."""
    while True:
        due_us = min((one.next_us for one in queues.values() if one.next_us is not None), default=until_us)
        if due_us is None:
            return
        at_us = due_us if until_us is None else min(due_us, until_us)
        await asyncio.sleep(max(0, at_us - loop.now_us()) / 1e6)
        for queue in queues.values():
            if queue.next_us is not None and queue.next_us <= loop.now_us():
                queue.release(loop.now_us())
        if until_us is not None and loop.now_us() >= until_us:
            return


def _words(machine: Machine, rights: int, time: int) -> list[Message]:
    """A plan of the most legs, all rights, a sign of life and two counts, the ``time``-th time."""
    node = machine.node_id
    words: list[Message] = [
        Heartbeat(node, 255, 0xF83E, 0x0F83 + time, 1, machine.kind, MachineState.WORKING),
        *(Diagnostic(node, reason, time) for reason in list(Reason)[1:3]),
    ]
    if machine.kind is not KindCode.ROBOT:
        return words
    legs = tuple(Leg(LegAction.TRAVEL, 1, 31, number, Side.NEAR, 1_000 * (2 + number)) for number in range(MOST_LEGS))
    plan = Itinerary(node, 1 + time, Grade.FIRM, Stamp(1_000, 1, 1), legs)
    asked = (TokenRequest(node, TokenKind.SEGMENT, 256 + number, 1, 1 + time, 0) for number in range(rights))
    return [plan, *asked, *words]

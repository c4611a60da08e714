"""A one-floor site with one car and some faults, looked at after a while."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.faults.arm import arm
from bus_sim.faults.bus import frame_faults
from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop, run
from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.wire.codec import device_codec
from onboard.wire.decoder import Decoder
from tests.sites import one_floor
from tests.system.scene import ORIGIN_US, stays


@dataclass
class Seen:
    """A simulation that has run, with every message of the fleet bus and of the robot's device bus."""

    simulation: Simulation
    fleet: list[tuple[int, Message]] = field(default_factory=list)
    device: list[tuple[int, Message]] = field(default_factory=list)
    #: What was said on the compartment's device bus.
    desk: list[Message] = field(default_factory=list)
    looks: list[object] = field(default_factory=list)

    def said_by(self, node: int, from_s: float, to_s: float) -> int:
        """How many messages a node said on the fleet bus in a span of time."""
        return sum(m.sender == node and from_s * 1e6 <= t < to_s * 1e6 for t, m in self.fleet)


def watch(
    *faults: str,
    seconds: float = 60,
    cars: int = 1,
    leave_s: float | None = None,
    look: tuple[float, Callable[[Simulation], object]] | None = None,
) -> Seen:
    """Run for so long; ``look`` is a time in s and what to note then. What nothing strikes is played once for all."""
    if not faults and look is None:
        return _undisturbed(seconds, cars, leave_s)
    return run(_watch(faults, seconds, cars, leave_s, look))


@cache
def _undisturbed(seconds: float, cars: int, leave_s: float | None) -> Seen:
    return run(_watch((), seconds, cars, leave_s, None))


async def _watch(
    faults: tuple[str, ...],
    seconds: float,
    cars: int,
    leave_s: float | None,
    look: tuple[float, Callable[[Simulation], object]] | None,
) -> Seen:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    injections = [parse_injection(fault) for fault in faults]
    site = one_floor()
    simulation = build(site, RunOptions(faults=frame_faults(injections, site)), loop)
    seen = Seen(simulation)
    simulation.observers.append(lambda message, time_us: seen.fleet.append((time_us, message)))
    decoder, desk_decoder = Decoder(device_codec()), Decoder(device_codec())

    def on_device(frame: Frame, time_us: int, _: str) -> None:
        message = decoder.feed(frame, time_us)
        if message is not None:
            seen.device.append((time_us, message))

    def on_desk(frame: Frame, time_us: int, _: str) -> None:
        message = desk_decoder.feed(frame, time_us)
        if message is not None:
            seen.desk.append(message)

    simulation.devices[11].tap(on_device, errors=ErrorsHeard.NONE)
    simulation.devices[1].tap(on_desk, errors=ErrorsHeard.NONE)
    simulation.plant.street.add_all(stays(*[(0.0, leave_s)] * cars), ORIGIN_US)
    arm(simulation, injections)
    simulation.start()
    if look is not None:
        simulation.plant.timers.call_at(round(look[0] * 1e6), lambda: seen.looks.append(look[1](simulation)))
    await asyncio.sleep(seconds)
    return seen

"""The robot of ``tests/foreign`` on the kit's bench: a life begins with each switching on, without a journal."""

from asyncio import TimerHandle
from collections.abc import Callable
from functools import partial

from bus_sim.run import FLEET
from bus_sim.systems.car_park.simulation import Simulation
from onboard.core.frame import Frame
from onboard.ports.bus import Bus
from onboard.systems.car_park.site import car_park
from tests.conform.bench import Switch
from tests.foreign.robot import Robot
from tests.foreign.site import Alley

#: From one wake to the next, so that a robot that is wrong does not stop time.
AT_LEAST_US = 1_000


class ForeignLife:
    """One robot from its start on; deaf and mute once it is ``off``."""

    def __init__(self, simulation: Simulation, buses: dict[str, Bus], boot: int) -> None:
        site, self.loop, self.buses = car_park(simulation.site), simulation.loop, buses
        machine, bay = site.machine("MR1"), site.compartments[min(site.compartments)]
        places = tuple(place.number for place in site.places)
        of = tuple(site.machines), site.digest, site.bitrate, site.stewards[1], site.tracks[1].length
        self.robot = Robot(Alley(machine.node_id, *of, machine.home.index, bay.number, places), boot=boot)
        self.timer: TimerHandle | None = None
        self.is_on = True
        for name, bus in buses.items():
            bus.subscribe(partial(self.on_frame, name))
        self.carry_out(self.robot.start())

    def off(self) -> None:
        self.is_on = False
        if self.timer is not None:
            self.timer.cancel()

    def on_frame(self, name: str, frame: Frame, _: int) -> None:
        if not self.is_on:
            return
        if frame.is_extended and not frame.is_remote:
            self.do(partial(self.robot.receive, name, frame.arbitration_id, frame.data, self.loop.now_us()))
        elif name == FLEET:
            self.do(partial(self.robot.drop, "UNKNOWN_IDENTIFIER", self.loop.now_us()))

    def wake(self) -> None:
        self.do(partial(self.robot.wake, self.loop.now_us()))

    def do(self, step: Callable[[], list[tuple[str, int, bytes]]]) -> None:
        """One step of it; where its numbers go out of their range its program ends until the power is cut."""
        try:
            frames = step()
        except OverflowError:
            self.off()
        else:
            self.carry_out(frames)

    def carry_out(self, frames: list[tuple[str, int, bytes]]) -> None:
        for name, number, data in frames:
            self.buses[name].send(Frame(number, data))
        if self.timer is not None:
            self.timer.cancel()
        due_us = self.robot.next_due()
        if due_us is not None:
            self.timer = self.loop.call_at(max(due_us, self.loop.now_us() + AT_LEAST_US) / 1e6, self.wake)


def joins(simulation: Simulation) -> Switch:
    node = simulation.site.machine("MR1").node_id
    lives: list[ForeignLife] = []
    buses: dict[str, Bus] = {
        FLEET: simulation.fleet.attach("foreign", node),
        "device": simulation.devices[node].attach("foreign", node),
    }

    def switch(on: bool) -> None:
        if lives:
            lives[-1].off()
        if on:
            lives.append(ForeignLife(simulation, buses, len(lives) + 1))

    return switch

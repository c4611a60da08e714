"""An operator's station on a simulated site: what it says to the person, and what it ended with."""

import asyncio
from dataclasses import dataclass, field

from bus_sim.systems.car_park.simulation import Simulation
from onboard.operate.commands import Maker
from onboard.operate.order import OperatorCommand
from onboard.operate.station import OperatorStation


@dataclass
class Played:
    """One command on a running site. ``status`` None: it has not ended."""

    lines: list[tuple[int, str]] = field(default_factory=list)
    status: int | None = None
    ended_us: int = 0
    asked: str = ""

    @property
    def text(self) -> str:
        """All that it said."""
        return "\n".join(line for _, line in self.lines)


def operates(simulation: Simulation, at_s: float, make: Maker, node: int | None = None) -> Played:
    """A person gives a command at ``at_s`` and agrees; to be called once the simulation runs."""
    played = Played()
    task = simulation.loop.create_task(_operate(simulation, played, at_s, make, node))
    task.add_done_callback(lambda done: None if done.cancelled() else done.result())
    return played


async def _operate(simulation: Simulation, played: Played, at_s: float, make: Maker, node: int | None) -> None:
    loop = simulation.loop
    await asyncio.sleep(at_s - loop.now_us() / 1e6)
    bus = simulation.fleet.attach(f"operator {at_s}", None)

    def tell(line: str) -> None:
        played.lines.append((loop.now_us(), line))

    async def agrees(order: OperatorCommand) -> bool:
        played.asked = order.question
        return True

    station = OperatorStation(simulation.site, simulation.codecs.fleet, bus, tell)
    played.status = await station.operate(make, node, agrees)
    played.ended_us = loop.now_us()
    await bus.close()

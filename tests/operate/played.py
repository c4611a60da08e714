"""An operator's station on a simulated site: what it says to the person, and what it ended with."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from bus_sim.run import Simulation
from onboard.operate.order import Order
from onboard.operate.park import Park
from onboard.operate.station import Station

Maker = Callable[[Park, int], Order]


@dataclass
class Played:
    """One command on a running site. ``status`` None: it has not ended."""

    lines: list[tuple[int, str]] = field(default_factory=list)
    status: int | None = None
    ended_us: int = 0
    order: Order | None = None

    @property
    def text(self) -> str:
        """All that it said."""
        return "\n".join(line for _, line in self.lines)


def operates(simulation: Simulation, at_s: float, make: Maker, node: int = 251, listen_s: float = 4.0) -> Played:
    """A person gives a command at ``at_s``; to be called once the simulation runs."""
    played = Played()
    simulation.loop.create_task(_operate(simulation, played, at_s, make, node, listen_s))
    return played


async def _operate(
    simulation: Simulation, played: Played, at_s: float, make: Maker, node: int, listen_s: float
) -> None:
    loop = simulation.loop
    await asyncio.sleep(at_s - loop.now_us() / 1e6)
    bus = simulation.fleet.attach(f"operator {node} {at_s}", node)

    def tell(line: str) -> None:
        played.lines.append((loop.now_us(), line))

    station = Station(simulation.site, simulation.codecs.fleet, bus, tell)
    if listen_s:
        await station.listen(round(listen_s * 1e6))
    played.order = make(station.park, station.speak_as(node))
    for line in played.order.preview(loop.now_us()):
        tell(line)
    played.status = await station.carry_out(played.order)
    played.ended_us = loop.now_us()
    await bus.close()

"""How many frames a second of wall time the simulated CAN bus carries, with 20 nodes that all listen.

Run from the checkout: ``python -m bench.bus_rate [seconds of virtual time]``. One table; nothing is written.
"""

import asyncio
import time
from collections.abc import Callable

from bench._arguments import given
from bus_sim.can.faults import InjectedFault, parse_fault
from bus_sim.can.medium import Medium
from bus_sim.can.node import SimulatedBus
from bus_sim.virtual_time import VirtualTimeLoop, run
from onboard.core.frame import Frame

NODES = 20
#: Virtual seconds of each run.
DURATION_S = 10.0


def _heard(_frame: Frame, _time_us: int) -> None:
    """The cheapest receiver there is."""


def _frame(sender: int, number: int) -> Frame:
    return Frame(0x10000000 | (number % 7) << 16 | sender, number.to_bytes(8, "big"))


def _saturate(loop: VirtualTimeLoop, node: SimulatedBus, sender: int) -> None:
    """Always have the next frame ready."""
    count = 0

    def again(_frame_sent: Frame, _time_us: int) -> None:
        nonlocal count
        count += 1
        node.send(_frame(sender, count))

    node.subscribe(_heard, again)
    again(_frame(sender, 0), loop.now_us())


def _half_load(loop: VirtualTimeLoop, node: SimulatedBus, sender: int) -> None:
    """Send a frame every 12.5 ms: 20 nodes make about half of 500 kbit/s."""
    count = 0

    def tick(when_us: int) -> None:
        nonlocal count
        count += 1
        node.send(_frame(sender, count))
        loop.at_us(when_us + 12_500, tick)

    node.subscribe(_heard)
    loop.at_us(sender * 613, tick)


Load = Callable[[VirtualTimeLoop, SimulatedBus, int], None]


async def _measure(load: Load, seconds: float, faults: tuple[InjectedFault, ...]) -> tuple[int, float, float]:
    """Frames carried, wall seconds, bus load."""
    loop = asyncio.get_running_loop()
    if not isinstance(loop, VirtualTimeLoop):
        raise TypeError("to be run in virtual time")
    medium = Medium(loop, faults=faults)
    for sender in range(NODES):
        load(loop, medium.attach(f"N{sender}", sender), sender)
    begin = time.perf_counter()
    await asyncio.sleep(seconds)
    wall_s = time.perf_counter() - begin
    statistics = medium.statistics()
    return statistics.frames, wall_s, statistics.mean_load


def main() -> None:
    """Print a row for each load: frames per wall second on the simulated bus."""
    seconds = given(seconds=(float, DURATION_S)).seconds
    fault = parse_fault("omission:receivers=3,probability=0.01,seed=7")
    rows: tuple[tuple[str, Load, tuple[InjectedFault, ...]], ...] = (
        ("every node always has a frame ready", _saturate, ()),
        ("every node sends each 12.5 ms", _half_load, ()),
        ("saturated, with an omission fault", _saturate, (fault,)),
    )
    print(f"{NODES} nodes, all listening; {seconds:g} s of virtual time at 500 kbit/s, 29-bit identifiers, 8 bytes\n")
    print(f"{'load':<38} {'frames':>8} {'bus load':>9} {'wall s':>8} {'frames/s':>10} {'x real time':>12}")
    for name, load, faults in rows:
        frames, wall_s, bus_load = run(_measure(load, seconds, faults))
        rate, speed = frames / wall_s, seconds / wall_s
        print(f"{name:<38} {frames:>8} {bus_load:>9.1%} {wall_s:>8.3f} {rate:>10,.0f} {speed:>12,.0f}")


if __name__ == "__main__":
    main()

"""The power comes on where one machine keeps hundreds of cars: its answer is more than its interface takes."""

import asyncio
from itertools import pairwise

from bus_sim.options import RunOptions
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Stay
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.systems.car_park.sizes import broken_limits
from bus_sim.systems.car_park.standing_cars import stand
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.systems.car_park.site import car_park

#: Its answer has three frames a car, and an interface takes 1,056: what came last, and said that it was all, never
#: went out, and each who had asked asked again, for ever.
CARS = 900
SECONDS = 6


async def frames_by_second(run: Simulation) -> list[int]:
    """Frames of the fleet bus in each second after power-up."""
    run.start()
    totals = [0]
    for _ in range(SECONDS):
        await asyncio.sleep(1)
        totals.append(run.fleet.statistics().frames)
    return [last - first for first, last in pairwise(totals)]


def test_all_take_part_within_seconds_and_the_bus_is_quiet_then() -> None:
    site, loop = car_park(find_site("tower")), VirtualTimeLoop()
    bodies = (random_car(f"car {number}", 1) for number in range(2 * CARS))
    cars = [body for body in bodies if not broken_limits(body, site)][:CARS]
    try:
        asyncio.set_event_loop(loop)
        run = build(site, RunOptions(seed=1, quiet=True), loop)
        stand(run, [Stay(0, None, body) for body in cars])
        frames = loop.run_until_complete(frames_by_second(run))
        waiting = [one.holon.machine.name for one in run.controllers.values() if not one.holon.tokens.is_synced]
    finally:
        asyncio.set_event_loop(None)
        loop.close()
    assert (waiting, frames[-1] < 100) == ([], True), frames

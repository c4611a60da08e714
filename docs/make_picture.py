"""Draws docs/standard.svg, the terminal picture of the hour that ``make run`` shows, at a busy moment.

Run: ``python docs/make_picture.py``.
"""

import asyncio
import re
from datetime import timedelta
from io import StringIO
from pathlib import Path

from rich.console import Console

from bus_sim.options import RunOptions
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay, choose_demand
from bus_sim.systems.car_park.show import DayClock, draw
from bus_sim.systems.car_park.simulation import build
from bus_sim.systems.car_park.stage import ORIGIN_US
from bus_sim.systems.car_park.window import two_way_hour, with_short_eve
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.systems.car_park.site import car_park

#: 15:38:25 local time: one car comes in, another goes out, robots share the street's alley.
MOMENT_S = 15 * 3600 + 38 * 60 + 25
#: Of the picture.
COLUMNS, LINES = 112, 30


async def _picture() -> str:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    site = car_park(find_site("standard"))
    demand = choose_demand(ParkingDay(), site)
    demand = with_short_eve(demand, two_way_hour(demand), len(site.compartments))
    first_us = demand.stays[0].arrival_us
    simulation = build(site, RunOptions(), loop)
    simulation.plant.street.add_all(demand, ORIGIN_US - first_us)
    simulation.start()
    await asyncio.sleep(MOMENT_S - first_us / 1e6 + ORIGIN_US / 1e6)
    assert demand.zero is not None
    clock = DayClock(demand.zero + timedelta(microseconds=first_us - ORIGIN_US))
    console = Console(record=True, width=COLUMNS, file=StringIO())
    street = simulation.plant.street.summary()
    line = (
        f"cars in {street.parked}  out {street.served}  inside {street.inside}  "
        f"calls {simulation.view.calls_opened}  bids {simulation.view.bids}  "
        f"bus load {simulation.fleet.statistics().mean_load:.2%}"
    )
    console.print(draw(site, simulation.view, clock, line, COLUMNS, LINES))
    svg = console.export_svg(title="bus-sim run")
    # rich's template asks another host for its font; the reader's own does as well.
    return re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL).replace("Fira Code", "DejaVu Sans Mono")


def main() -> None:
    """Draw the picture."""
    loop = VirtualTimeLoop()
    asyncio.set_event_loop(loop)
    svg = loop.run_until_complete(_picture())
    Path(__file__).with_name("standard.svg").write_text(svg, encoding="utf-8")
    loop.close()


if __name__ == "__main__":
    main()

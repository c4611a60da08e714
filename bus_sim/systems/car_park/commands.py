"""What ``bus-sim`` can do with sites of this system alone."""

from bus_sim.systems.car_park.compare.command import add_compare as add
from bus_sim.systems.car_park.compare.command import run_compare

RUN = {"compare": run_compare}

__all__ = ["RUN", "add"]

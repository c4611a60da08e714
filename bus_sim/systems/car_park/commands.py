"""What ``bus-sim`` can do with sites of this system alone."""

import argparse

from bus_sim.systems.car_park.compare.command import add_compare, run_compare
from bus_sim.systems.car_park.design.command import add_design, run_design

RUN = {"compare": run_compare, "design": run_design}


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the commands of this system to those of ``bus-sim``."""
    add_compare(commands)
    add_design(commands)

"""What ``bus-sim`` can do with sites of this system alone."""

from bus_sim.systems.graph.certify.command import add_certify as add
from bus_sim.systems.graph.certify.command import run_certify

RUN = {"certify": run_certify}

__all__ = ["RUN", "add"]

"""What ``bus-sim`` can do with sites of this system alone."""

from bus_sim.systems.mapd.importers.command import add_import as add
from bus_sim.systems.mapd.importers.command import run_import

RUN = {"import": run_import}

__all__ = ["RUN", "add"]

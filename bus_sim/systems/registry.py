"""How sites of all systems but the car park are run: the one place to add a system's plant, picture and indicators."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bus_sim.faults.injection import AnyFault
from bus_sim.systems.cell.run import run_cell
from bus_sim.systems.graph.run import run_graph
from bus_sim.systems.mapd.run import run_mapd
from bus_sim.systems.terminal.show import run_terminal
from bus_sim.systems.turning.run import run_turning
from onboard.core.site import Site


@dataclass(frozen=True)
class SystemOptions:
    """What ``bus-sim run`` was asked for, beside the site.

    ``speed`` is in simulated seconds a second, None for as fast as possible; ``epoch_us`` the wall time of loop time 0.
    ``limit_s`` ends a run that does not end by itself. ``web`` is where its page is served, None for nowhere.
    """

    seed: int = 1
    speed: float | None = None
    limit_s: float | None = None
    trace: Path | None = None
    devices: bool = False
    json: Path | None = None
    faults: tuple[AnyFault, ...] = ()
    epoch_us: int = 0
    quiet: bool = False
    web: str | None = None


#: Runs a site to its end, prints what came of it, and returns the exit status: 0, or 1 where a rule was broken.
Runner = Callable[[Site, SystemOptions], int]

#: By ``Site.system``.
RUNNERS: dict[str, Runner] = {
    "terminal": run_terminal,
    "cell": run_cell,
    "graph": run_graph,
    "mapd": run_mapd,
    "turning": run_turning,
}

"""Trials of all other systems: the site's own orders, or orders that the seed draws. A new system is one entry here."""

from collections.abc import Sequence
from typing import Final

from bus_sim.faults.injection import AnyFault
from bus_sim.faults.scenario import Scenario
from bus_sim.run import BusRun, RunOptions
from bus_sim.systems.cell.orders import CELL
from bus_sim.systems.graph.orders import GRAPH
from bus_sim.systems.mapd.orders import MAPD
from bus_sim.systems.orders import Orders, System, Tally
from bus_sim.systems.session import arm_all, build, check_faults
from bus_sim.systems.terminal.orders import TERMINAL
from bus_sim.systems.turning.orders import TURNING
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site

#: By ``Site.system``.
SYSTEMS: Final[dict[str, System]] = {
    "cell": CELL,
    "graph": GRAPH,
    "mapd": MAPD,
    "terminal": TERMINAL,
    "turning": TURNING,
}
#: Faults begin so long after power-up, s: the machines have found each other, and the first orders are there.
BEGIN_S = 12.0
#: A run is given up after so many times what an order takes, and once more for each that is usual: they may all wait.
PATIENCE = 20


def usual_orders(site: Site, count: int | None, apart_s: float | None) -> Orders:
    """What a seed brings: of what is not asked for, what is usual on the system."""
    usual = SYSTEMS[site.system].usual(site)
    return Orders(usual.count if count is None else count, usual.apart_s if apart_s is None else apart_s)


def with_orders(site: Site, orders: Orders | None, seed: int) -> Site:
    """The site with what a seed brings. Raises ``DemandError`` for orders that it cannot bring."""
    return site if orders is None or not orders.count else SYSTEMS[site.system].draw(site, orders, seed)


def span_s(site: Site) -> tuple[float, float]:
    """When faults may begin, s after power-up: from the first of the site's orders to where the last should be done."""
    system = SYSTEMS[site.system]
    return BEGIN_S, max(BEGIN_S, system.last_s(site)) + system.order_s(site)


def patience_s(site: Site) -> float:
    """When a run with the site's orders is given up, s after power-up."""
    system = SYSTEMS[site.system]
    return span_s(site)[1] + (PATIENCE + system.usual(site).count) * system.order_s(site)


class SystemStage:
    """See ``Stage``. Raises ``DemandError`` for a fault that the site cannot have, and for orders it cannot bring."""

    def __init__(self, site: Site, scenario: Scenario, options: RunOptions, loop: VirtualTimeLoop) -> None:
        self._system = SYSTEMS[site.system]
        self.who = self._system.who
        check_faults(scenario.faults, site)
        self.run: BusRun
        drawn = with_orders(site, scenario.orders, scenario.seed)
        self.run, self._plant = build(drawn, options, loop, self._system.plant)

    @property
    def is_broken(self) -> bool:
        """See ``Stage``."""
        return bool(self._plant.violations)

    @property
    def is_over(self) -> bool:
        """See ``Stage``."""
        return self._plant.is_over

    def arm(self, faults: Sequence[AnyFault]) -> None:
        """See ``Stage``."""
        arm_all(self.run, faults)

    def violations(self) -> list[str]:
        """See ``Stage``."""
        return list(self._plant.violations)

    def waits_since(self, time_us: int) -> int:
        """See ``Stage``."""
        return 0

    def tally(self) -> Tally:
        """See ``Stage``."""
        return self._system.tally(self._plant)

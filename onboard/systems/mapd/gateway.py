"""A pick-up and delivery site at the gateway: robots by the cells that they tell; orders come in at its desk only."""

from onboard.contract.messages import Message
from onboard.gateway.edge import SystemEdge
from onboard.gateway.positions import MachinePosition, Tracker
from onboard.history.history import Fact, History
from onboard.systems.mapd.history import CellTold, mapd_history
from onboard.systems.mapd.site import Mapd


class CellTracker:
    """Robots that move from cell to cell, a step at a time; no coordinates."""

    def __init__(self, site: Mapd, history: History) -> None:
        self._names = site.floor.names
        self._seen = mapd_history(history)

    def take(self, message: Message, fact: Fact | None) -> bool:
        """Robots say in which cell they are at each step."""
        return isinstance(fact, CellTold)

    def where(self, node_id: int) -> MachinePosition:
        """The cell where the robot said that it is."""
        return MachinePosition(self._names[self._seen.cells[node_id]], passed=self._seen.passed[node_id])


class MapdEdge(SystemEdge):
    """What the gateway tells of a floor of cells; it takes no orders."""

    def __init__(self, site: Mapd) -> None:
        super().__init__(site)
        self._floor = site

    def tracker(self, history: History) -> Tracker:
        """By the cell of each step."""
        return CellTracker(self._floor, history)


EDGE = MapdEdge

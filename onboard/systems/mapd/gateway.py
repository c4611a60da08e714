"""A pick-up and delivery site at the gateway: robots by the cells that they tell; orders come in at its desk only."""

from dataclasses import replace

from onboard.contract.mapd import StepState
from onboard.contract.messages import Message
from onboard.gateway.edge import SystemEdge
from onboard.gateway.positions import MachinePosition, Tracker
from onboard.systems.mapd.site import Mapd


class CellTracker:
    """Robots that move from cell to cell, a step at a time; no coordinates."""

    def __init__(self, site: Mapd) -> None:
        self._names = site.floor.names
        self._at = {node: MachinePosition(self._names[cell]) for node, cell in site.homes.items()}

    def feed(self, message: Message) -> bool:
        """Robots say in which cell they are at each step."""
        if not isinstance(message, StepState) or message.sender not in self._at or message.cell >= len(self._names):
            return False
        old, node = self._at[message.sender], self._names[message.cell]
        self._at[message.sender] = replace(old, node=node, passed=old.passed + (node != old.node))
        return True

    def where(self, node_id: int) -> MachinePosition:
        """The cell where the robot said that it is."""
        return self._at[node_id]


class MapdEdge(SystemEdge):
    """What the gateway tells of a floor of cells; it takes no orders."""

    def __init__(self, site: Mapd) -> None:
        super().__init__(site)
        self._floor = site

    def tracker(self) -> Tracker:
        """By the cell of each step."""
        return CellTracker(self._floor)


EDGE = MapdEdge

"""Attacks in a car park's own words."""

from collections.abc import Iterator

from bus_sim.attacks import words
from bus_sim.attacks.attack import AttackerNode
from onboard.contract.codes import OperatorAction
from onboard.contract.messages import CarAt, Message, OperatorOrder, Reference
from onboard.systems.car_park.site import car_park


class ForgedRetrievals(words.ForgedOrders):
    """Other people's cars are ordered out."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._cars: set[Reference] = set()

    def hear(self, message: Message, now_us: int) -> None:
        """Remembers every car that anybody has told the place of."""
        if isinstance(message, CarAt):
            self._cars.add(message.car)

    def orders(self) -> Iterator[Message]:
        """An urgent ticket for each known car at every compartment."""
        for compartment in car_park(self.node.site).compartments:
            for car in sorted(self._cars):
                yield OperatorOrder(self.node.node_id, compartment, OperatorAction.URGENT_TICKET, car)

"""Attacks in a car park's own words."""

from collections.abc import Iterator

from bus_sim.attacks import words
from bus_sim.attacks.attack import Node
from onboard.contract.codes import OperatorAction
from onboard.contract.messages import CarAt, Message, OperatorOrder, Reference
from onboard.systems.car_park.site import car_park


class Orders(words.Orders):
    """Other people's cars are ordered out."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._cars: set[Reference] = set()

    def hear(self, message: Message, now_us: int) -> None:
        """See ``Attack``."""
        if isinstance(message, CarAt):
            self._cars.add(message.car)

    def orders(self) -> Iterator[Message]:
        """See ``words.Orders``."""
        for compartment in car_park(self.node.site).compartments:
            for car in sorted(self._cars):
                yield OperatorOrder(self.node.node_id, compartment, OperatorAction.URGENT_TICKET, car)

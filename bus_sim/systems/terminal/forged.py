"""Attacks in a terminal's own words."""

from collections.abc import Iterator

from bus_sim.attacks import words
from onboard.contract.messages import Message
from onboard.contract.terminal import BoxOrder
from onboard.systems.terminal.site import EntityKind
from onboard.systems.terminal.vehicle import terminal


class ForgedTransports(words.ForgedOrders):
    """Urgent orders for boxes, said by somebody who is no desk."""

    def orders(self) -> Iterator[Message]:
        """One box to one station, both drawn by chance, in the desk's name."""
        site, chance = terminal(self.node.site), self.node.chance
        stations = [number for number, one in site.entities.items() if one.kind is EntityKind.STATION]
        box, station = chance.randint(1, len(site.boxes)), chance.choice(stations)
        yield BoxOrder(self.node.node_id, site.desk, self.number, box, station, 0, True)

"""Orders for a graph as a seed draws them: from one node to another, most for whoever is near."""

from dataclasses import replace

from bus_sim.systems.graph.plant import ORIGIN_US, GraphPlant
from bus_sim.systems.orders import OrderArrivals, last_of, nothing_to_draw, tally_of
from bus_sim.systems.stage import Tally
from onboard.contract.codes import OrderResult
from onboard.systems.graph.site import MAX_STOPS, FactoryGraph, VisitOrder

#: So many orders name their robot: enough that each seed has both sorts.
NAMED = 0.2
#: About what one order takes, s: measured on the shipped site.
ORDER_S = 50.0


def draw(site: FactoryGraph, orders: OrderArrivals, seed: int) -> FactoryGraph:
    """The site with drawn orders. Raises ``DemandError`` for a graph of one node."""
    chance, nodes, drawn = orders.chance(site.name, seed), site.graph.nodes, []
    if len(nodes) < 2:
        raise nothing_to_draw(site.name, "one node only")
    for at_ms in orders.moments_ms(chance):
        # Whoever is near carries from one node to another; a robot that is named visits as many as a frame holds.
        robot = chance.choice(list(site.robots)) if chance.random() < NAMED else 0
        stops = chance.randint(1, min(MAX_STOPS, len(nodes))) if robot else 2
        drawn.append(VisitOrder(at_ms, robot, tuple(chance.sample(nodes, stops))))
    return replace(site, orders=tuple(drawn))


def last_s(site: FactoryGraph) -> float:
    """When the last order comes, s after power-up."""
    return last_of((one.at_ms for one in site.orders), ORIGIN_US)


def count(plant: GraphPlant) -> Tally:
    """What became of the orders."""
    done, refused, expected = OrderResult.DONE, OrderResult.REFUSED, len(plant.site.orders)
    return tally_of(plant.entries, done, refused, expected, plant.timers.now_us())


def usual(site: FactoryGraph) -> OrderArrivals:
    """Four for each robot of the shipped hall."""
    return OrderArrivals(12, ORDER_S / max(1, len(site.robots)))

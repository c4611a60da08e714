"""Orders for a graph as a seed draws them: from one node to another, most for whoever is near."""

from dataclasses import replace
from typing import cast

from bus_sim.systems.graph.plant import ORIGIN_US, GraphPlant, make_plant
from bus_sim.systems.orders import Orders, System, Tally, last_of, nothing_to_draw, tally_of
from bus_sim.systems.session import SystemPlant
from onboard.core.site import Site
from onboard.systems.graph.messages import OrderResult
from onboard.systems.graph.site import MAX_STOPS, FactoryGraph, Order

#: So many orders name their robot. Ours.
NAMED = 0.2
#: About what one order takes, s: measured on the shipped site.
ORDER_S = 50.0


def draw(site: Site, orders: Orders, seed: int) -> FactoryGraph:
    """The site with drawn orders. Raises ``DemandError`` for a graph of one node."""
    assert isinstance(site, FactoryGraph)
    chance, nodes, drawn = orders.chance(site.name, seed), site.graph.nodes, []
    if len(nodes) < 2:
        raise nothing_to_draw(site.name, "one node only")
    for at_ms in orders.moments_ms(chance):
        # Whoever is near carries from one node to another; a robot that is named visits as many as a frame holds.
        robot = chance.choice(list(site.robots)) if chance.random() < NAMED else 0
        stops = chance.randint(1, min(MAX_STOPS, len(nodes))) if robot else 2
        drawn.append(Order(at_ms, robot, tuple(chance.sample(nodes, stops))))
    return replace(site, orders=tuple(drawn))


def last_s(site: Site) -> float:
    """When the last order comes, s after power-up."""
    assert isinstance(site, FactoryGraph)
    return last_of((one.at_ms for one in site.orders), ORIGIN_US)


def count(plant: SystemPlant) -> Tally:
    """What became of the orders."""
    graph = cast("GraphPlant", plant)
    done, refused, expected = OrderResult.DONE, OrderResult.REFUSED, len(graph.site.orders)
    return tally_of(graph.entries, done, refused, expected, graph.timers.now_us())


def usual(site: Site) -> Orders:
    """Four for each robot of the shipped hall."""
    assert isinstance(site, FactoryGraph)
    return Orders(12, ORDER_S / max(1, len(site.robots)))


GRAPH = System(make_plant, draw, last_s, count, lambda _: ORDER_S, usual)

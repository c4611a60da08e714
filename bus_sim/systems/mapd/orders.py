"""Tasks for a pick-up and delivery site as a seed draws them: between its endpoints."""

from dataclasses import replace
from statistics import fmean

from bus_sim.systems.mapd.plant import UnitPlant
from bus_sim.systems.orders import EndedOrder, OrderArrivals, nothing_to_draw, tally
from bus_sim.systems.stage import Tally
from onboard.contract.codes import OrderResult
from onboard.systems.mapd.site import Mapd, TransportTask
from onboard.ways.steps import FAR

#: So many endpoints are looked at to see how long ways are: enough for a mean, and cheap.
SAMPLE = 12


def draw(site: Mapd, orders: OrderArrivals, seed: int) -> Mapd:
    """The site with drawn tasks. Raises ``DemandError`` for one with fewer than two endpoints."""
    if len(site.endpoints) < 2:
        raise nothing_to_draw(site.name, "fewer than two endpoints")
    chance = orders.chance(site.name, seed)
    tasks = [
        TransportTask(number, at_ms // site.step_ms, *chance.sample(site.endpoints, 2))
        for number, at_ms in enumerate(orders.moments_ms(chance))
    ]
    return replace(site, tasks=tuple(tasks))


def last_s(site: Mapd) -> float:
    """When the last order comes, s after power-up."""
    return max((one.release for one in site.tasks), default=0) * site.step_us / 1e6


def count(plant: UnitPlant) -> Tally:
    """What became of the tasks."""
    ended = []
    for one in plant.goods.values():
        refused = one.answer is OrderResult.REFUSED and one.served_step is None
        ended.append(EndedOrder(one.served_step is not None, refused, one.ordered_us, one.served_us))
    return tally(ended, len(plant.site.tasks), plant.timers.now_us())


def order_s(site: Mapd) -> float:
    """Twice the mean way between endpoints: to the pick-up and with the load; half as much again for the others."""
    some = site.endpoints[:: -(-len(site.endpoints) // SAMPLE)]
    ways = [site.floor.steps_to(end)[start] for end in some for start in some if start != end]
    known = [way for way in ways if way < FAR]
    return max(1.0, 3 * fmean(known or [1]) * site.step_us / 1e6)


def usual(site: Mapd) -> OrderArrivals:
    """As the robots can just carry out."""
    return OrderArrivals(16, order_s(site) / max(1, len(site.robots)))

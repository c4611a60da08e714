"""Orders for a turning cell as a seed draws them: the site's own kinds of part, in other numbers and another order."""

from dataclasses import replace

from bus_sim.systems.orders import OrderArrivals, last_of, nothing_to_draw, tally_of
from bus_sim.systems.stage import Tally
from bus_sim.systems.turning.plant import ORIGIN_US, TurningPlant
from onboard.contract.codes import OrderResult
from onboard.systems.turning.site import BatchDemand, Turning

#: Parts of an order, at least and at most: a batch of a small shop.
BATCH = (1, 3)
#: About what one order takes, s: measured on the shipped site.
ORDER_S = 1_500.0


def draw(site: Turning, orders: OrderArrivals, seed: int) -> Turning:
    """The site with drawn orders. Raises ``DemandError`` for a site without any of its own, whose parts they take."""
    if not site.orders:
        raise nothing_to_draw(site.name, "no orders to take the parts of")
    chance = orders.chance(site.name, seed)
    drawn = []
    for at_ms in orders.moments_ms(chance):
        job = chance.choice(site.orders).job
        drawn.append(BatchDemand(at_ms, replace(job, batch=chance.randint(*BATCH))))
    return replace(site, orders=tuple(drawn))


def last_s(site: Turning) -> float:
    """When the last order comes, s after power-up."""
    return last_of((one.at_ms for one in site.orders), ORIGIN_US)


def count(plant: TurningPlant) -> Tally:
    """What became of the orders."""
    done, refused, expected = OrderResult.DONE, OrderResult.REFUSED, len(plant.site.orders)
    return tally_of(plant.entries, done, refused, expected, plant.timers.now_us())

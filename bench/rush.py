"""All cars of a site are asked for within minutes: how long their drivers wait, and how long it takes.

Run: ``python bench/rush.py [SITE [CARS GAP [SEED]]]``, by default 30 cars on ``standard``, one asked for each 20 s on
average, seed 1. They come in a minute apart, and the rush begins ten minutes after the last. Virtual time: the figures
are the same on every machine.
"""

import random

from bench._arguments import a_count, a_site, given
from bench.overload import played
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.sizes import broken_limits
from onboard.systems.car_park.site import CarPark, car_park

SECOND_US = 1_000_000
#: They come in so far apart, and are asked for so long after the last of them at the earliest, us.
APART_US, CALM_US = 60 * SECOND_US, 600 * SECOND_US


def rush(site: CarPark, cars: int, gap_s: float, seed: int) -> Demand:
    """The stays of one rush: who is asked for when is drawn."""
    chance = random.Random(f"rush:{seed}")
    bodies = (random_car(f"car {number}", seed) for number in range(10 * cars))
    fitting = [body for body in bodies if not broken_limits(body, site)][:cars]
    leaves_us, at_us = [], cars * APART_US + CALM_US
    for _ in fitting:
        at_us += round(chance.expovariate(1 / gap_s) * SECOND_US)
        leaves_us.append(at_us)
    chance.shuffle(leaves_us)
    return Demand(tuple(Stay(number * APART_US, leaves_us[number], body) for number, body in enumerate(fitting)))


def main() -> None:
    """Play one rush, and print what drivers waited."""
    words = given(site=(a_site, "standard"), cars=(a_count, 30), gap=(float, 20.0), seed=(a_count, 1))
    site, cars, gap_s, seed = car_park(find_site(words.site)), words.cars, words.gap, words.seed
    demand = rush(site, cars, gap_s, seed)
    probe = played(site, demand, seed)
    visits = [customer.visit for customer in probe.simulation.plant.street.customers]
    waits_s = [visit.out_wait_us / SECOND_US for visit in visits if visit.out_wait_us is not None]
    last_us = max(visit.gone_us or 0 for visit in visits)
    begin_us = min(visit.asked_us or last_us for visit in visits)
    mean_s, span_s = sum(waits_s) / len(waits_s), (last_us - begin_us) / SECOND_US
    print(f"{site.name}: {len(waits_s)} of {cars} cars out, one asked for each {gap_s:g} s, seed {seed}")
    print(f"waited {mean_s:.1f} s, at most {max(waits_s):.0f} s; {span_s:.0f} s in all")


if __name__ == "__main__":
    main()

"""Sites for tests, as TOML text."""

from dataclasses import replace

from onboard.config.site import parse_site
from onboard.core.site import Site
from onboard.systems.car_park.site import CallAt, CarPark, car_park

ONE_FLOOR = """
[site]
name = "test"
[floors]
count = 1
positions = {positions}
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
"""


def one_floor(robots: int = 1, positions: int = 12, extra: str = "") -> CarPark:
    """One alley, a compartment at p(1,4), robots MR1.. on nodes 11.. at the highest positions, one apart.

    Several robots on one alley are more than the loader takes by itself.
    """
    text = ONE_FLOOR.format(positions=positions)
    for number in range(1, robots + 1):
        text += f'[[robots]]\nname = "MR{number}"\nnode = {10 + number}\nhome = "p(1,{positions + 1 - number})"\n'
    return car_park(parse_site(text + extra, "test.toml", crowded=True))


def at_the_key(site: Site) -> CarPark:
    """The same car park, whose compartments call with the key and for a locked bay, as in the paper (row P50)."""
    return replace(car_park(site), call_at=CallAt.KEY)


def at_arrival(site: Site) -> CarPark:
    """The same car park, whose compartments call for whoever drives in, and for the next car while they work."""
    return replace(car_park(site), call_at=CallAt.ARRIVAL)


def telling(site: Site) -> CarPark:
    """The same car park, whose bids bring their itineraries as in the paper."""
    return replace(car_park(site), tells_offers=True)

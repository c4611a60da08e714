"""What nobody can beat: each customer alone in an empty park, a robot already standing where it is needed (us).

Door, shuttle and customer take as long as they do in the plant; messages, tokens and thinking take no time; the car
stands in the place from which a compartment is reached first. For a car that comes in, no robot is waited for at all.
"""

import random
from dataclasses import dataclass
from typing import NamedTuple

from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.bodies import DRIVER_S
from bus_sim.systems.car_park.plant.customer import REACTION_US, WALK_S
from bus_sim.systems.car_park.plant.door import BOLT_US
from onboard.core.site import Site
from onboard.systems.car_park.site import car_park
from onboard.ways.kinematics import run_duration_us
from onboard.ways.roads import roads_of


class Acts(NamedTuple):
    """A customer's own acts, us: driving in, walking out with the ticket, driving out again."""

    drive_in_us: int
    walk_us: int
    drive_out_us: int

    @classmethod
    def of(cls, stay: Stay, seed: int) -> "Acts":
        """What the plant's customer will draw in a run of this seed."""
        chance = random.Random(f"customer:{seed}:{stay.car.name}")
        return cls(*(round(chance.uniform(*span) * 1e6) for span in (DRIVER_S, WALK_S, DRIVER_S)))


@dataclass(frozen=True)
class FreeFlow:
    """The least times of a site's parts, us."""

    close_us: int
    open_us: int
    handle_us: int
    #: From the nearest place to its compartment.
    way_us: int

    @classmethod
    def of(cls, site: Site) -> "FreeFlow":
        """The least times of a site."""
        roads = roads_of(site)
        park = car_park(site)
        fronts = frozenset(station.segment for station in site.compartments.values())
        return cls(
            close_us=site.timing.door_us + BOLT_US,
            open_us=site.timing.door_us,
            handle_us=2 * run_duration_us(park.shuttle_reach_mm, park.shuttle) + site.timing.grip_us,
            way_us=min(roads.nearest_us(place.segment, fronts) for place in site.places),
        )

    def in_us(self, acts: Acts) -> int:
        """From coming to walking away with a ticket."""
        return REACTION_US + acts.drive_in_us + acts.walk_us

    def out_us(self, acts: Acts) -> int:
        """From the ticket in the desk to driving out.

        The input door locks, the car is taken, brought and set down, the output door locks, the input door opens.
        """
        fetched_us = self.close_us + self.handle_us + self.way_us + self.open_us + self.handle_us
        return fetched_us + self.close_us + self.open_us + REACTION_US + acts.drive_out_us


def bounds_us(site: Site, demand: Demand, seed: int) -> tuple[list[int], list[int]]:
    """Least waiting in of all who come, and out of all who come back, in the order of the demand."""
    least = FreeFlow.of(site)
    acts = [(stay, Acts.of(stay, seed)) for stay in demand.stays]
    return (
        [least.in_us(one) for _, one in acts],
        [least.out_us(one) for stay, one in acts if stay.departure_us is not None],
    )

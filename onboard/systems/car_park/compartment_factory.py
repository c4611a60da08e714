"""What makes a compartment: its task-generation function, and its steps."""

from dataclasses import dataclass, field, replace

from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.systems.car_park.bay_generation import BayGeneration
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import Program
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.tickets import TicketCodes
from onboard.ways.mirror import WayFleet, way_fleet, way_mirror


@dataclass(frozen=True)
class CompartmentFactory(BehaviourFactory):
    """Makes compartments: a bay with doors, a desk, and the custody of cars. ``codes`` are those of its tickets."""

    fleet_type = WayFleet
    codes: TicketCodes = field(default_factory=TicketCodes)

    def with_secrets(self, secrets: tuple[bytes, ...]) -> "CompartmentFactory":
        """The same, whose desks print and read tickets under these secrets."""
        return replace(self, codes=TicketCodes(secrets))

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> BayGeneration:
        """What a task at the bay costs: a compartment bids to receive cars."""
        park, known = car_park(site), way_mirror(mirror)
        robots = CarParkGeneration(park, machine, known, Program(park))
        return BayGeneration(park, machine, robots.floor, known.cars)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Compartment:
        """The compartment's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, BayGeneration):
            raise TypeError("a compartment needs its own task-generation function")
        return Compartment(way_fleet(fleet), estimator, self.codes)

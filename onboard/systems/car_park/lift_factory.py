"""What makes a lift: its task-generation function, and its steps."""

from dataclasses import dataclass

from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.lift_generation import LiftGeneration
from onboard.ways.mirror import WayFleet, way_fleet, way_mirror
from onboard.ways.site import way_site


@dataclass(frozen=True)
class LiftFactory(BehaviourFactory):
    """Makes lifts: machines that bid for rides."""

    fleet_type = WayFleet

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> LiftGeneration:
        """What a ride costs, around those that are planned."""
        return LiftGeneration(way_site(site), machine, way_mirror(mirror))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Lift:
        """The lift's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, LiftGeneration):
            raise TypeError("a lift needs its own task-generation function")
        return Lift(way_fleet(fleet), estimator)

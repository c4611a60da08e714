"""What makes a lift: its task-generation function, and its steps."""

from dataclasses import dataclass

from onboard.core.behaviour import Fleet
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.lift_generation import LiftGeneration


@dataclass(frozen=True)
class LiftFactory:
    """Makes lifts."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> LiftGeneration:
        """The lift's task-generation function."""
        return LiftGeneration(site, machine, mirror)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Lift:
        """The lift's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, LiftGeneration):
            raise TypeError("a lift needs its own task-generation function")
        return Lift(fleet, estimator)

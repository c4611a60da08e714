"""What the machines of a pick-up and delivery site are made of."""

from dataclasses import dataclass

from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.systems.mapd.bidding import UnitGeneration
from onboard.systems.mapd.desk import TransportDesk
from onboard.systems.mapd.robot import UnitRobot
from onboard.systems.mapd.site import Mapd
from onboard.work.plain import NoEstimator


@dataclass(frozen=True)
class UnitRobotFactory(BehaviourFactory):
    """Makes robots that move in unit steps."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> UnitGeneration:
        """What its bids come from. Raises ``TypeError`` for a site of another system."""
        if not isinstance(site, Mapd):
            raise TypeError("a machine of a pick-up and delivery site needs one")
        return UnitGeneration()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> UnitRobot:
        """The robot's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, UnitGeneration):
            raise TypeError("a robot needs its own task-generation function")
        return UnitRobot(fleet, generation=estimator)


@dataclass(frozen=True)
class OrderDeskFactory(BehaviourFactory):
    """Makes the site's one desk, which calls for tasks."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """A desk bids for nothing."""
        if not isinstance(site, Mapd):
            raise TypeError("a machine of a pick-up and delivery site needs one")
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> TransportDesk:
        """A desk that begins with the tasks of its journal."""
        return TransportDesk(fleet)

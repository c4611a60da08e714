"""What the machines of a pick-up and delivery site are made of."""

from dataclasses import dataclass

from onboard.core.behaviour import BehaviourFactory, Fleet, NoEstimator
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.systems.mapd.desk import OrderDesk
from onboard.systems.mapd.robot import UnitRobot
from onboard.systems.mapd.site import Mapd


@dataclass(frozen=True)
class _Factory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """Nothing: tasks are auctioned all together, step by step; a call for one by itself finds nobody."""
        if not isinstance(site, Mapd):
            raise TypeError("a machine of a pick-up and delivery site needs one")
        return NoEstimator()


@dataclass(frozen=True)
class UnitRobotFactory(_Factory):
    """Makes robots."""

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> UnitRobot:
        """The robot's steps."""
        return UnitRobot(fleet)


@dataclass(frozen=True)
class OrderDeskFactory(_Factory):
    """Makes the desk."""

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> OrderDesk:
        """The desk's steps."""
        return OrderDesk(fleet)

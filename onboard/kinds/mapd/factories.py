"""What the machines of a pick-up and delivery site are made of."""

from onboard.core.behaviour import Fleet
from onboard.core.messages import CallForProposals
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, Proposal
from onboard.core.site import Machine, Site
from onboard.kinds.mapd.desk import OrderDesk
from onboard.kinds.mapd.robot import UnitRobot
from onboard.kinds.mapd.site import Mapd


class NoSingleCalls:
    """Tasks are auctioned all together, step by step; a call for one task by itself finds nobody."""

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Never asked for."""
        return 0

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """None: it bids in rounds only."""
        return None

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """None: it bids in rounds only."""
        return None


class _Factory:
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoSingleCalls:
        """Nothing to offer to single calls."""
        if not isinstance(site, Mapd):
            raise TypeError("a machine of a pick-up and delivery site needs one")
        return NoSingleCalls()


class UnitRobotFactory(_Factory):
    """Makes robots."""

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> UnitRobot:
        """The robot's steps."""
        return UnitRobot(fleet)


class OrderDeskFactory(_Factory):
    """Makes the desk."""

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> OrderDesk:
        """The desk's steps."""
        return OrderDesk(fleet)

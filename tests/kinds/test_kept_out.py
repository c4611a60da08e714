"""A robot that waits with its car before a bay: whose plans tell that the car in it will be taken away."""

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp
from onboard.core.site import Station
from onboard.systems.car_park.kept_out import will_work
from onboard.ways.mirror import WayMirror
from tests.sites import one_floor

ME, OTHER = 11, 12
BAY = Station(1, 4, Side.NEAR)


@pytest.mark.parametrize(("version", "leg", "is_ahead"), [(1, 0, True), (1, 1, False), (7, 1, True)])
def test_whoever_brought_a_car_to_a_bay_and_goes_home_does_not_take_it_away(
    version: int, leg: int, is_ahead: bool
) -> None:
    """A plan is told with its work until it is over; what its machine says of another plan tells nothing."""
    mirror = WayMirror(one_floor(robots=2), ME)
    legs = (Leg(LegAction.WORK, 1, 4, 4, Side.NEAR, 20_000), Leg(LegAction.TRAVEL, 1, 4, 9, Side.NEAR, 30_000))
    plan = Itinerary(OTHER, 1, Grade.FIRM, Stamp(0, OTHER, 0), legs)
    mirror.on_itinerary(plan, 0)
    mirror.on_progress(Progress(OTHER, version, leg, 1, 4, 0, 0))
    assert will_work(mirror, plan, BAY) is is_ahead

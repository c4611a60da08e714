"""Two robots face to face at a lift's sill: one aboard that wants out, one before it that has no other way than in."""

from collections.abc import Iterator
from unittest.mock import PropertyMock, patch

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import LegAction, TokenKind
from onboard.contract.messages import Itinerary, Progress, Stamp, TokenRequest
from onboard.core.authority import segment_token
from onboard.core.effects import Send
from onboard.core.site import Segment
from onboard.holon.holon import Holon
from onboard.systems.car_park.program import CarStep
from onboard.systems.car_park.robot import ParkingRobot
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.standoff import PATIENCE_US
from onboard.systems.car_park.travel import Carriage
from onboard.systems.registry import factory_for

SITE = car_park(find_site("small"))
ME, OTHER = 11, 12
#: The stop of the left lift on floor 2, as the alley has it; its platform; the slot before the sill.
STOP, PLATFORM, BEFORE = Segment(2, 0), Segment(128, 0), Segment(2, 1)
NOW_US = 60_000_000


@pytest.fixture
def aboard() -> Iterator[Holon]:
    """I stand aboard, am to run to p(2,3), and wait for the slot of the other, which wants the platform."""
    holon = Holon(SITE, SITE.machines[ME], factory_for(SITE, SITE.machines[ME].kind), boot=1)
    holon.start(0)
    holon.tokens.trust()
    robot = holon.behaviour
    assert isinstance(robot, ParkingRobot)
    run = CarStep(LegAction.TRAVEL, 2, 0, 3, NOW_US, NOW_US + 9_000_000)
    robot.generation.program.begin(STOP, [run], Stamp(50_000, 1, 1))
    fleet, platform = robot.fleet, segment_token(PLATFORM)
    fleet.tokens.beliefs.take_up(segment_token(BEFORE), 1, OTHER)
    fleet.petitions.hear(platform, TokenRequest(OTHER, TokenKind.SEGMENT, platform.number, 0, 1, 0), NOW_US)
    fleet.mirror.progress[OTHER] = Progress(OTHER, 1, 0, BEFORE.track, BEFORE.index, 0, 0)
    robot.carriage.blocked = BEFORE
    stands = patch.object(Carriage, "standing_at", PropertyMock(return_value=STOP))
    with stands, patch.object(Carriage, "occupied", lambda _: [PLATFORM]):
        yield holon


def test_who_stands_aboard_rides_on_where_nobody_before_the_sill_can_let_it_out(aboard: Holon) -> None:
    """On `harbour`, after twenty hours without a fault, both stood for ever: nobody changed its plan aboard."""
    robot = aboard.behaviour
    assert isinstance(robot, ParkingRobot)
    platform = segment_token(PLATFORM)
    asks = TokenRequest(OTHER, TokenKind.SEGMENT, platform.number, 0, 1, 0)
    plans: list[Itinerary] = []
    for later_us in (0, PATIENCE_US, 2 * PATIENCE_US):
        robot.fleet.petitions.hear(platform, asks, NOW_US + later_us)
        said = robot.going_around.advance(NOW_US + later_us)
        plans += [one.message for one in said if isinstance(one, Send) and isinstance(one.message, Itinerary)]
    assert plans, "it waits for the other for ever"
    moves = [leg for leg in plans[-1].legs if leg.action is not LegAction.STAND]
    assert (moves[0].action, moves[0].track) == (LegAction.RIDE, PLATFORM.track)

"""Two robots face to face, each in the slot that the other wants next: who goes where, so that both go on."""

from collections.abc import Iterator
from unittest.mock import PropertyMock, patch

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import Grade, LegAction, Side, TokenKind
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp, TokenRequest
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
from tests.sites import one_floor

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


def standing(holon: Holon, here: Segment, way: list[CarStep]) -> ParkingRobot:
    """A robot that takes part and stands ``here``, before what it wants to do."""
    holon.start(0)
    holon.tokens.trust()
    robot = holon.behaviour
    assert isinstance(robot, ParkingRobot)
    robot.generation.program.begin(here, way, Stamp(50_000, 1, 1))
    return robot


def test_who_can_only_go_back_makes_room_for_who_works() -> None:
    """On a drawn site both stood for ever, one on its way to a bay, the other on its way out of the alley's end."""
    site = one_floor(robots=2)
    holon = Holon(site, site.machines[ME], factory_for(site, site.machines[ME].kind), boot=1)
    here, before = Segment(1, 2), Segment(1, 3)
    robot = standing(holon, here, [CarStep(LegAction.TRAVEL, 1, 2, 8, NOW_US, NOW_US + 15_000_000)])
    fleet = robot.fleet
    legs = (
        Leg(LegAction.TRAVEL, 1, 3, 2, Side.NEAR, 70_000),
        Leg(LegAction.WORK, 1, 2, 2, Side.NEAR, 90_000),
        Leg(LegAction.TRAVEL, 1, 2, 12, Side.NEAR, 110_000),
    )
    fleet.mirror.on_itinerary(Itinerary(OTHER, 1, Grade.FIRM, Stamp(50_000, 1, 2), legs), NOW_US)
    fleet.mirror.on_progress(Progress(OTHER, 1, 0, before.track, before.index, 0, 0))
    fleet.tokens.beliefs.take_up(segment_token(before), 1, OTHER)
    robot.carriage.blocked = before
    plans: list[Itinerary] = []
    stands = patch.object(Carriage, "standing_at", PropertyMock(return_value=here))
    with stands, patch.object(Carriage, "occupied", lambda _: [here]):
        for later_us in (0, PATIENCE_US, 2 * PATIENCE_US):
            asks = TokenRequest(OTHER, TokenKind.SEGMENT, segment_token(here).number, 0, 1, 0)
            fleet.petitions.hear(segment_token(here), asks, NOW_US + later_us)
            said = robot.going_around.advance(NOW_US + later_us)
            plans += [one.message for one in said if isinstance(one, Send) and isinstance(one.message, Itinerary)]
    assert plans, "both stand for ever"
    moves = [(leg.from_index, leg.to_index) for leg in plans[-1].legs if leg.action is LegAction.TRAVEL]
    assert moves == [(2, 1)], "where the other does not come"

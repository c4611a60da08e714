"""Two robots face to face, each in the slot that the other wants next: who goes where, so that both go on."""

from collections.abc import Iterator
from unittest.mock import PropertyMock, patch

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import Grade, LegAction, Side, TokenKind
from onboard.contract.constants import NOBODY
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
from onboard.ways.mirror import WayMirror
from onboard.ways.occupancy import turn_in_us
from onboard.ways.retreats import put_off
from onboard.ways.told_way import BegunItinerary
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


def standing(here: Segment, way: list[CarStep]) -> ParkingRobot:
    """A robot on one floor that takes part and stands ``here``, before what it wants to do."""
    site = one_floor(robots=2)
    holon = Holon(site, site.machines[ME], factory_for(site, site.machines[ME].kind), boot=1)
    holon.start(0)
    holon.tokens.trust()
    robot = holon.behaviour
    assert isinstance(robot, ParkingRobot)
    robot.generation.program.begin(here, way, Stamp(50_000, 1, 1))
    return robot


def facing(robot: ParkingRobot, here: Segment, legs: tuple[Leg, ...], place: Segment) -> None:
    """The other's plan leads to where I am, and it stands in the slot that I want."""
    fleet = robot.fleet
    fleet.mirror.on_itinerary(Itinerary(OTHER, 1, Grade.FIRM, Stamp(50_000, 1, 2), legs), NOW_US)
    fleet.mirror.on_progress(Progress(OTHER, 1, 0, place.track, place.index, 0, 0))
    fleet.tokens.beliefs.take_up(segment_token(place), 1, OTHER)
    robot.carriage.blocked = place


def plans_of(robot: ParkingRobot, here: Segment) -> list[Itinerary]:
    """What I tell while both stand: I have had patience twice by then."""
    plans: list[Itinerary] = []
    fleet, slot = robot.fleet, segment_token(here)
    stands = patch.object(Carriage, "standing_at", PropertyMock(return_value=here))
    with stands, patch.object(Carriage, "occupied", lambda _: [here]):
        for later_us in (0, PATIENCE_US, 2 * PATIENCE_US):
            asks = TokenRequest(OTHER, TokenKind.SEGMENT, slot.number, 0, 1, 0)
            fleet.petitions.hear(slot, asks, NOW_US + later_us)
            said = robot.going_around.advance(NOW_US + later_us)
            plans += [one.message for one in said if isinstance(one, Send) and isinstance(one.message, Itinerary)]
    return plans


def moves_of(plan: Itinerary) -> list[tuple[int, int, int]]:
    return [(leg.track, leg.from_index, leg.to_index) for leg in plan.legs if leg.action is LegAction.TRAVEL]


#: From p(1,3) to work at p(1,2), and out of the alley's end again.
WORKING = (
    Leg(LegAction.TRAVEL, 1, 3, 2, Side.NEAR, 70_000),
    Leg(LegAction.WORK, 1, 2, 2, Side.NEAR, 90_000),
    Leg(LegAction.TRAVEL, 1, 2, 12, Side.NEAR, 110_000),
)


def test_who_can_only_go_back_makes_room_for_who_works() -> None:
    """On a drawn site both stood for ever, one on its way to a bay, the other on its way out of the alley's end."""
    here = Segment(1, 2)
    robot = standing(here, [CarStep(LegAction.TRAVEL, 1, 2, 8, NOW_US, NOW_US + 15_000_000)])
    facing(robot, here, WORKING, Segment(1, 3))
    plans = plans_of(robot, here)
    assert plans, "both stand for ever"
    assert moves_of(plans[-1]) == [(1, 2, 1)], "where the other does not come"


def test_who_faces_another_that_still_wants_its_place_does_not_come_behind_it() -> None:
    """On a drawn site the other had no way around me and came behind me; each told later times for the other's."""
    here = Segment(1, 2)
    robot = standing(here, [CarStep(LegAction.TRAVEL, 1, 2, 8, NOW_US, NOW_US + 15_000_000)])
    facing(robot, here, WORKING, Segment(1, 3))
    fleet = robot.fleet
    asks = TokenRequest(OTHER, TokenKind.SEGMENT, segment_token(here).number, 0, 1, 0)
    fleet.petitions.hear(segment_token(here), asks, NOW_US)
    with patch.object(Carriage, "occupied", lambda _: [here]):
        robot.going_around.advance(NOW_US)
    fleet.mirror.on_itinerary(robot.generation.program.itinerary(ME, NOW_US), NOW_US)
    standoff = robot.going_around.standoff
    assert standoff.goes_first(OTHER, NOW_US) == NOBODY
    away = (Leg(LegAction.TRAVEL, 1, 3, 5, Side.NEAR, 70_000),)
    fleet.mirror.on_itinerary(Itinerary(OTHER, 2, Grade.FIRM, Stamp(50_000, 1, 2), away), NOW_US)
    assert standoff.goes_first(OTHER, NOW_US) == OTHER, "it turns away"


def test_room_is_made_for_what_another_does_then_though_it_should_have_gone_by_long_ago() -> None:
    """On a drawn site nobody found a way to make room: the other counted as one that stands there for ever."""
    mirror = WayMirror(one_floor(robots=2), ME)
    here, place = Segment(1, 2), Segment(1, 3)
    late = Itinerary(OTHER, 1, Grade.FIRM, Stamp(40_000, 1, 2), WORKING)
    mirror.on_itinerary(late, NOW_US)
    mirror.on_progress(Progress(OTHER, 1, 0, place.track, place.index, 0, 0))
    plan = put_off(mirror.site, mirror.plans[OTHER], 0, place, NOW_US + 16_000_000)
    assert plan is not None
    with mirror.as_told(BegunItinerary(plan, NOW_US), NOW_US):
        others = mirror.reservations_at(here, NOW_US, may_stay=False)
    begins = [one.from_us for one in others.planned().safe_intervals(place, ME, NOW_US)]
    assert begins != [], "it stands there for ever"


def test_who_waits_for_its_turn_into_the_alley_can_wait_longer() -> None:
    """On a drawn site nobody made room for who stood in a spur's end: what it does later was not thought of."""
    site = one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n')
    out = (Leg(LegAction.TRAVEL, 1, 7, 7, Side.NEAR, 70_000), Leg(LegAction.TRAVEL, 1, 7, 12, Side.NEAR, 80_000))
    plan = BegunItinerary(Itinerary(OTHER, 1, Grade.FIRM, Stamp(50_000, 1, 2), out), NOW_US)
    inside = Segment(192, 1)
    later = put_off(site, plan, 0, inside, NOW_US + 16_000_000)
    assert later is not None
    turn_ms = turn_in_us(site, 192) // 1000
    assert later.legs == (
        Leg(LegAction.STAND, 192, 1, 1, Side.NEAR, 76_000),
        out[0]._replace(end_ms=76_000 + turn_ms),
        out[1]._replace(end_ms=86_000 + turn_ms),
    )
    assert put_off(site, plan, 0, Segment(1, 3), NOW_US) is None, "it is somewhere else"

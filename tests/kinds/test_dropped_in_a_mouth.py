"""A robot that loses its work in the mouth of a spur, or of an alley, plans from there, turned or not."""

import pytest

from onboard.contract.codes import DriveMode, LegAction
from onboard.contract.messages import DriveState, Itinerary, Progress, Stamp
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.holon.holon import Holon
from onboard.systems.car_park.program import CarStep
from onboard.systems.car_park.robot import ParkingRobot
from onboard.systems.registry import factory_for
from onboard.ways.mirror import WayMirror
from tests.kinds.test_turning import INSIDE, MOUTH, MOUTH_MM, OTHER, ROBOT, site

NOW_US = 60_000_000


@pytest.fixture(params=[False, True], ids=["not turned yet", "turned"])
def robot(request: pytest.FixtureRequest) -> ParkingRobot:
    """It stands in the mouth, is to go into the spur, and waits for the right to that."""
    here = site()
    holon = Holon(here, here.machines[ROBOT], factory_for(here, here.machines[ROBOT].kind), boot=1)
    holon.start(0)
    holon.tokens.trust()
    made = holon.behaviour
    assert isinstance(made, ParkingRobot)
    hop = CarStep(LegAction.TRAVEL, INSIDE.track, INSIDE.index, INSIDE.index, NOW_US, NOW_US + 9_000_000)
    made.generation.program.begin(MOUTH, [hop], Stamp(50_000, 1, 1))
    made.carriage.sense(DriveState(ROBOT, 1, MOUTH_MM, 0, DriveMode.STANDING, True, False), 0)
    made.carriage.go(INSIDE)
    if request.param:
        across_mm = made.carriage.axis.position_mm(0)
        made.carriage.sense(DriveState(ROBOT, 1, across_mm, 0, DriveMode.STANDING, True, True), 0)
    assert made.carriage.standing_at == Segment(INSIDE.track, 0)
    return made


def plan(effects: list[Effect]) -> Itinerary:
    return [one.message for one in effects if isinstance(one, Send) and isinstance(one.message, Itinerary)][-1]


def test_it_plans_a_way_from_the_mouth(robot: ParkingRobot) -> None:
    """It told that it stood at the end of the spur's axis, from where no way leads, for the rest of its life."""
    told = plan(robot.going_around.drop([], NOW_US))
    assert told.legs and told.legs[-1].action is LegAction.TRAVEL
    assert (told.legs[0].track, told.legs[0].from_index) in [tuple(MOUTH), tuple(INSIDE)]


def test_with_no_way_from_there_it_stands_in_the_mouth(robot: ParkingRobot) -> None:
    mirror = robot.fleet.mirror
    assert isinstance(mirror, WayMirror)
    around = [MOUTH._replace(index=MOUTH.index - 1), MOUTH._replace(index=MOUTH.index + 1), INSIDE]
    mirror.on_progress(Progress(OTHER, 1, 0, 1, 12, 0, 0))
    with mirror.as_obstacle(OTHER, frozenset(around), NOW_US):
        told = plan(robot.going_around.drop([], NOW_US))
    (stands,) = told.legs
    assert (stands.action, stands.track, stands.to_index) == (LegAction.STAND, *MOUTH)

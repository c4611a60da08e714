"""A car that nobody bids for: all robots rest where one itinerary does not tell the way to it, to the bay and home."""

import pytest

from onboard.config.site import parse_site
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, CallForProposals, CarAt, Message, Reference, Stamp
from onboard.core.site import Segment, Station
from onboard.holon.holon import Holon
from onboard.systems.car_park.fetching import can_fetch
from onboard.systems.car_park.out_of_reach import OutOfReach
from onboard.systems.car_park.robot import ParkingRobot
from onboard.systems.car_park.site import CarPark, car_park
from onboard.systems.registry import factory_for

#: Three lines behind one another; the first has two lifts that one drives through.
TEXT = """
alleys = [
    { name = "A2", positions = 7 }, { name = "A3", positions = 6 }, { name = "B1", positions = 5 },
    { name = "C1", positions = 8 },
    { name = "X1", floors = [1], positions = 4, pitch_mm = 2_640, from = "p(*,1)", to = "p(*,B1,1)", sides = [] },
    { name = "X2", floors = [1], positions = 4, pitch_mm = 2_640, from = "p(*,B1,1)", to = "p(*,C1,1)", sides = [] },
]
lifts = [
    { name = "L1", node = 101, doors = ["p(*,8)", "p(*,A2,1)"] },
    { name = "L2", node = 102, doors = ["p(*,A2,7)", "p(*,A3,1)"] },
    { name = "L3", node = 103, doors = ["p(*,B1,5)"] },
    { name = "L4", node = 104, doors = ["p(*,C1,8)"] },
]
compartments = [{ name = "IOC1", node = 1, at = "p(1,A3,4)" }, { name = "IOC2", node = 2, at = "p(1,C1,5)" }]
robots = [{ name = "MR1", node = 11, home = "p(2,C1,5)" }, { name = "MR2", node = 12, home = "p(2,B1,3)" }]
[site]
name = "far"
[floors]
count = 2
positions = 8
"""
FAR_BAY, CAR, TASK = 2, Reference(1, 1), Reference(2, 7)


@pytest.fixture(scope="module")
def site() -> CarPark:
    return car_park(parse_site(TEXT, "far.toml"))


def words(site: CarPark) -> tuple[CallForProposals, Award]:
    """The far bay calls for the car at the other end of the site, and gives up: nobody has bid."""
    place = next(one for one in site.places if one.segment == Segment(5, 2))
    call = CallForProposals(
        FAR_BAY,
        300,
        TASK,
        Operation.RETRIEVE,
        KindCode.ROBOT,
        Criterion.FINISH_TIME,
        5,
        0,
        60_000,
        place.number,
        site.compartments[FAR_BAY].number,
        CAR,
        2_500,
    )
    return call, Award(FAR_BAY, 300, NOBODY, TASK, 1, CallResult.REFUSED, Reason.NO_BID)


def heard(site: CarPark, *messages: Message) -> OutOfReach:
    found = OutOfReach(site)
    for message in messages:
        found.hear(message)
    return found


def test_who_rests_nearest_goes_to_where_it_can_tell_the_rest(site: CarPark) -> None:
    call, refused = words(site)
    near, mine, farther = Segment(6, 2), site.machines[12].home, site.machines[11].home
    car, bay = Station.from_number(call.from_station).segment, Station.from_number(call.to_station).segment
    assert not can_fetch(site, farther, car, bay)
    assert can_fetch(site, near, car, bay)
    known = heard(site, call, refused)
    assert known.refuge(farther, [], [near]) == near
    assert known.refuge(farther, [mine], [near]) is None, "another is nearer"
    assert heard(site, call).refuge(farther, [], [near]) is None, "it is called for still"


@pytest.mark.parametrize("how", ["awarded", "moved"])
def test_a_car_that_is_fetched_or_gone_calls_nobody(site: CarPark, how: str) -> None:
    call, refused = words(site)
    gone: tuple[Message, ...] = (CarAt(1, CAR, 0, 2, 2_500),)
    if how == "awarded":
        gone = (call, Award(FAR_BAY, 300, 11, TASK, 1, CallResult.AWARDED, Reason.NONE))
    assert heard(site, call, refused, *gone).refuge(site.machines[11].home, [], [Segment(6, 2)]) is None


def test_a_robot_with_nothing_to_do_sets_off(site: CarPark) -> None:
    """On a drawn site ten cars were called for over and over for an hour, without any fault."""
    call, refused = words(site)
    holon = Holon(site, site.machines[11], factory_for(site, site.machines[11].kind), boot=1)
    holon.start(0)
    robot = holon.behaviour
    assert isinstance(robot, ParkingRobot)
    robot.generation.program.begin(site.machines[11].home, [], Stamp(0, 11, 0))
    now_us = 60_000_000
    for message in (call, refused):
        robot.resting.hear(message, now_us)
    due_us = robot.resting.next_wake()
    assert due_us is not None
    robot.resting.sets_off(due_us)
    assert robot.resting.sets_off(due_us + 20_000_000)
    last = robot.generation.program.remaining[-1]
    car, bay = Station.from_number(call.from_station).segment, Station.from_number(call.to_station).segment
    assert can_fetch(site, Segment(last.track, last.to_index), car, bay)

"""Row P50: the 21 steps of Fig. 9 with the car aboard the lift, from the street to the only floor that has places."""

from collections.abc import Sequence

import pytest

from onboard.config.site import parse_site
from onboard.contract.codes import (
    CallResult,
    DeskInput,
    DeskText,
    DoorPosition,
    DriveMode,
    Grade,
    KindCode,
    LegAction,
    LightColour,
    Operation,
    ShuttleMode,
    TaskPhase,
    TokenKind,
)
from onboard.contract.messages import (
    Award,
    BayState,
    Bid,
    CallForProposals,
    CarAt,
    DeskEvent,
    DeskOrder,
    DoorState,
    DriveState,
    Itinerary,
    PlatformState,
    Progress,
    ShuttleState,
    TaskReport,
    TokenGrant,
)
from onboard.core.authority import segment_token
from onboard.systems.car_park.site import CarPark
from onboard.ways.lifts import gate, platform
from tests.cut import Timed, first_of, shown_at
from tests.sites import at_the_key, telling
from tests.system.scene import Scene, play, stays

BAY, LIFT, SHAFT, FLOOR = 1, 5, 128, 3


def park() -> CarPark:
    """Three floors; the street and the second have no places."""
    text = """
    site = {name = "entry", bitrate = 500_000}
    floors = {count = 3, positions = 6, without = ["p(1-2,*)"]}
    compartments = [{name = "IOC1", node = 1, at = "p(1,4)"}]
    lifts = [{name = "ER1", node = 5, end = "left"}]
    robots = [{name = "MR1", node = 11, home = "p(2,3)"}, {name = "MR2", node = 12, home = "p(3,5)"}]
    """
    return telling(at_the_key(parse_site(text, "entry.toml")))


@pytest.fixture(scope="module")
def scene() -> Scene:
    found = play(park(), stays((0, None)), extra_s=150)
    found.assert_sound()
    return found


def check(said: Sequence[Timed]) -> None:
    """The steps one after the other; raises ``AssertionError`` where one is missing or out of its order."""
    left_us, _ = first_of(said, BayState, lambda m: m.load_kg > 0)  # 1: the car is left in the compartment
    key_us, _ = first_of(said, DeskEvent, lambda m: m.event is DeskInput.KEY)  # 2: the key is pressed
    ticket_us, ticket = first_of(said, DeskOrder, lambda m: m.text is DeskText.TAKE_TICKET)
    # 3, 4: the call, for all robots
    call_us, call = first_of(said, CallForProposals, lambda m: m.operation is Operation.PARK and m.sender == BAY)
    assert (call.kind, call.car) == (KindCode.ROBOT, ticket.car)
    # 5: the input door closes, the light turns red
    red_us, _ = first_of(said, DoorState, lambda m: m.light is LightColour.RED, call_us)
    locked_us, _ = first_of(said, DoorState, lambda m: m.input_door is DoorPosition.LOCKED, call_us)
    # 7 to 9: a better performance is told with the segments that it takes
    bid_us, bid = first_of(said, Bid, lambda m: (m.initiator, m.call) == (BAY, call.call))
    award_us, award = first_of(said, Award, lambda m: m.task == call.task)
    robot = award.winner
    told_us, plan = first_of(said, Itinerary, lambda m: (m.sender, m.grade) == (bid.sender, Grade.TENTATIVE), bid_us)
    assert bid.itinerary_version == plan.version and award.result is CallResult.AWARDED
    # 10, 11: task and segments are engaged, over a ride to the floor of the place
    firm_us, firm = first_of(
        said, Itinerary, lambda m: (m.sender, m.grade) == (robot, Grade.FIRM) and len(m.legs) > 2, award_us
    )
    works = [number for number, leg in enumerate(firm.legs) if leg.action is LegAction.WORK]
    rides = [leg for leg in firm.legs[works[0] : works[1]] if leg.action is LegAction.RIDE]
    assert [(leg.track, leg.from_index, leg.to_index) for leg in rides] == [(SHAFT, 1, FLOOR)]
    # 12: the robot moves to the compartment; 6, as flag 5 has it: there the output door opens
    moves_us, _ = first_of(said, DriveState, lambda m: m.sender == robot and m.mode is DriveMode.MOVING, firm_us)
    front_us, _ = first_of(said, BayState, lambda m: m.carrier_in_front, moves_us)
    opened_us, _ = first_of(said, DoorState, lambda m: m.output_door is DoorPosition.OPEN, call_us)
    # 13: it loads the car
    reached_us, _ = first_of(said, ShuttleState, lambda m: m.sender == robot and m.mode is ShuttleMode.REACHED)
    loaded_us, _ = first_of(said, TaskReport, lambda m: (m.task, m.phase) == (call.task, TaskPhase.LOADED))
    # 14: the output door closes, the input door opens, the light is green
    closed_us, _ = first_of(said, DoorState, lambda m: m.output_door is DoorPosition.LOCKED, loaded_us)
    open_us, _ = first_of(said, DoorState, lambda m: m.input_door is DoorPosition.OPEN, loaded_us)
    green_us, _ = first_of(said, DoorState, lambda m: m.light is LightColour.GREEN, loaded_us)
    # 15, 16: the ride is in the plan that the lift has heard; it tells that it stands at the robot's floor
    here_us, _ = first_of(said, Progress, lambda m: (m.sender, m.index, m.speed_mm_s) == (LIFT, 1, 0), firm_us)
    # 17: the robot gets in, with the car
    boards_us = granted(said, gate(SHAFT).index, robot, max(here_us, loaded_us))
    aboard_us, _ = first_of(said, PlatformState, lambda m: m.sender == LIFT and m.carrier_aboard, boards_us)
    loads = [m.load_kg for at, m in said if isinstance(m, ShuttleState) and m.sender == robot and at < boards_us]
    # 18, 19: the lift moves, and reaches the floor
    back_us = granted(said, gate(SHAFT).index, LIFT, boards_us)
    rides_us, _ = first_of(said, DriveState, lambda m: m.sender == LIFT and m.mode is DriveMode.MOVING, back_us)
    there_us, _ = first_of(said, Progress, lambda m: (m.sender, m.index, m.speed_mm_s) == (LIFT, FLOOR, 0), rides_us)
    # 20: it unloads the robot
    leaves_us = granted(said, gate(SHAFT).index, robot, there_us)
    off_us, _ = first_of(said, PlatformState, lambda m: m.sender == LIFT and not m.carrier_aboard, leaves_us)
    free_us = granted(said, platform(SHAFT).index, LIFT, leaves_us)
    # 21: it goes to the place and leaves the car
    place = firm.legs[works[1]]
    stands_us, _ = first_of(
        said,
        Progress,
        lambda m: (m.sender, m.track, m.index, m.speed_mm_s) == (robot, FLOOR, place.to_index, 0),
        off_us,
    )
    done_us, done = first_of(said, TaskReport, lambda m: (m.task, m.phase) == (call.task, TaskPhase.DONE), stands_us)
    there = [m.station for _, m in said if isinstance(m, CarAt) and m.car == call.car]
    assert there and there[-1] == done.station and done.station >> 8 == FLOOR
    engaged = [left_us, key_us, call_us, bid_us, told_us, award_us, firm_us, moves_us, front_us, opened_us, reached_us]
    rest = [loaded_us, boards_us, aboard_us, back_us, rides_us, there_us, leaves_us, off_us, stands_us, done_us]
    assert engaged + rest == sorted(engaged + rest)
    assert key_us < ticket_us < red_us < locked_us < opened_us, "the output door waits for the locked input door"
    assert loaded_us < closed_us < open_us < green_us < done_us
    assert loads[-1] > 0 and here_us < boards_us and leaves_us < free_us < done_us


def granted(said: Sequence[Timed], index: int, holder: int, after_us: int) -> int:
    """When a token of the shaft went to ``holder``."""
    key = (TokenKind.SEGMENT, SHAFT << 8 | index)
    return first_of(said, TokenGrant, lambda m: ((m.token_kind, m.token), m.holder) == (key, holder), after_us)[0]


def test_p50_the_21_steps_with_the_car_aboard_the_lift_to_another_floor(scene: Scene) -> None:
    assert segment_token(gate(SHAFT)).number == SHAFT << 8 | gate(SHAFT).index
    kinds = (Award, BayState, Bid, CallForProposals, CarAt, DeskEvent, DeskOrder, DoorState, DriveState, Itinerary)
    more = (PlatformState, Progress, ShuttleState, TaskReport, TokenGrant)
    shown_at(check, [(one.time_us, one.message) for one in scene.said], *kinds, *more)

"""A sill is crossed on the gate and the lift's word under that gate: never on an earlier word, a plan or a clock."""

from bus_sim.sites import find_site
from onboard.contract.codes import DriveMode, Grade, KindCode, LegAction, Reason, ShuttleMode, Side, TokenKind
from onboard.contract.messages import (
    BusTime,
    DriveOrder,
    DriveState,
    Itinerary,
    Leg,
    Message,
    PlatformState,
    Progress,
    ShuttleState,
    Stamp,
    SyncRequest,
    TokenGrant,
    TokenRequest,
)
from onboard.core.authority import segment_token
from onboard.core.behaviour import Fleet
from onboard.core.effects import Actuate, Effect, Send
from onboard.core.site import Segment
from onboard.holon.holon import Holon
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.robot import ParkingRobot
from onboard.systems.car_park.site import car_park
from onboard.systems.registry import factory_for
from onboard.ways.lifts import gate, platform, says_standing, under_gate

SITE = car_park(find_site("small"))
BAY, LIFT, ROBOT, OTHER = 1, 5, 11, 12
SHAFT = 128
FLOOR = 2
PITCH_MM = SITE.tracks[FLOOR].pitch_mm


def orders(effects: list[Effect]) -> list[DriveOrder]:
    return [one.message for one in effects if isinstance(one, Actuate) and isinstance(one.message, DriveOrder)]


def said(effects: list[Effect]) -> list[Message]:
    return [one.message for one in effects if isinstance(one, Send)]


class AtTheSill:
    """A robot at p(2,1) that wants to go aboard, with the platform's token and its gate's under ``version``."""

    def __init__(self, version: int) -> None:
        self.holon = Holon(SITE, SITE.machines[ROBOT], factory_for(SITE, KindCode.ROBOT))
        self.holon.start(0)
        self.holon.receive(BusTime(BAY, 0), 0)
        self.holon.tokens.trust()
        self.holon.sense(ShuttleState(ROBOT, 0, ShuttleMode.HOME, 0, Side.NEAR, 0, 2_500), 5)
        self.holon.sense(DriveState(ROBOT, 0, 0, 0, DriveMode.STANDING, True), 10)
        assert isinstance(self.holon.behaviour, ParkingRobot)
        self.carriage = self.holon.behaviour.carriage
        self.fleet: Fleet = self.holon.fleet
        self.grant(Segment(FLOOR, 1), 1)
        self.grant(platform(SHAFT), 7)
        self.grant(gate(SHAFT), version)
        self.carriage.go(Segment(FLOOR, 0))

    def grant(self, slot: Segment, version: int) -> None:
        self.fleet.tokens.on_grant(TokenGrant(LIFT, TokenKind.SEGMENT, slot.number, version, ROBOT), 20)

    def lift_says(self, index: int, version: int, *, speed_mm_s: int = 0, offset_mm: int = 0) -> None:
        self.fleet.mirror.on_progress(Progress(LIFT, *under_gate(version), SHAFT, index, offset_mm, speed_mm_s))

    def goes_aboard(self, now_us: int = 30) -> bool:
        return any(order.target_mm < 0 for order in orders(self.carriage.advance(now_us)))


def test_gate_and_word_under_it_let_a_robot_aboard() -> None:
    robot = AtTheSill(45)
    robot.lift_says(2, 45)
    assert robot.goes_aboard()


def test_the_gate_alone_is_no_proof() -> None:
    assert not AtTheSill(45).goes_aboard()


def test_an_earlier_word_is_no_proof() -> None:
    """It stood here when the gate was away before; since then it had the gate itself, and may have gone."""
    robot = AtTheSill(45)
    robot.lift_says(2, 43)
    assert not robot.goes_aboard()


def test_a_word_of_a_gate_that_looks_the_same_in_eight_bits_is_no_proof() -> None:
    robot = AtTheSill(45 + 256)
    robot.lift_says(2, 45)
    assert not robot.goes_aboard()


def test_a_lift_that_moves_or_stands_beside_its_mark_is_no_proof() -> None:
    robot = AtTheSill(45)
    robot.lift_says(2, 45, speed_mm_s=10)
    assert not robot.goes_aboard()
    robot.lift_says(2, 45, offset_mm=6)
    assert not robot.goes_aboard(40)


def test_a_word_that_changes_while_the_robot_moves_ends_its_orders() -> None:
    robot = AtTheSill(45)
    robot.lift_says(2, 45)
    assert robot.goes_aboard()
    robot.holon.sense(DriveState(ROBOT, robot.carriage.sequence, -500, -300, DriveMode.MOVING, False), 100_000)
    refresh_us = SITE.timing.drive_refresh_us
    assert robot.goes_aboard(100_000 + refresh_us)
    robot.lift_says(2, 45, speed_mm_s=-50)
    assert not orders(robot.carriage.advance(100_000 + 3 * refresh_us))


def test_without_a_word_the_lift_is_asked_again_and_again() -> None:
    robot = AtTheSill(45)
    times = [0, 1_500_000, 3_000_000, 4_500_000]
    asked = [said(robot.carriage.advance(now_us)).count(SyncRequest(ROBOT, LIFT)) for now_us in times]
    assert asked == [0, 1, 1, 1]
    robot.lift_says(2, 45)
    assert robot.goes_aboard(5_000_000)
    assert robot.carriage.sill.next_wake() is None


def test_half_off_the_platform_without_a_word_the_lift_is_asked_too() -> None:
    """An older word that came late: it stood across the sill, and nobody would have said the newer one again."""
    robot = AtTheSill(45)
    robot.lift_says(2, 45)
    assert robot.goes_aboard()
    robot.holon.sense(DriveState(ROBOT, robot.carriage.sequence, -PITCH_MM // 2, 0, DriveMode.STANDING, False), 100)
    robot.carriage.go(Segment(FLOOR, 1))
    robot.lift_says(1, 43)
    times = [0, 1_500_000, 3_000_000]
    asked = [said(robot.carriage.advance(now_us)).count(SyncRequest(ROBOT, LIFT)) for now_us in times]
    assert asked == [0, 1, 1]
    robot.lift_says(2, 45)
    assert orders(robot.carriage.advance(4_000_000))


def test_a_robot_that_the_lift_waits_for_elsewhere_gives_both_back() -> None:
    robot = AtTheSill(45)
    robot.lift_says(1, 45)
    effects = robot.carriage.advance(30)
    assert not orders(effects)
    given = [(m.token, m.holder) for m in said(effects) if isinstance(m, TokenGrant)]
    assert given == [(gate(SHAFT).number, LIFT), (platform(SHAFT).number, LIFT)]


def test_a_drive_that_has_not_taken_up_the_last_order_does_not_stand_yet() -> None:
    robot = AtTheSill(45)
    robot.lift_says(2, 45)
    assert robot.goes_aboard()
    robot.carriage.go(Segment(FLOOR, 1))
    assert not robot.carriage.arrived
    robot.holon.sense(DriveState(ROBOT, robot.carriage.sequence, 0, 0, DriveMode.STANDING, True), 100_000)
    assert robot.carriage.arrived


# --- the lift --------------------------------------------------------------------------------------------------


def itinerary(version: int, *legs: Leg, award_ms: int = 0) -> Itinerary:
    return Itinerary(ROBOT, version, Grade.FIRM, Stamp(award_ms, BAY, 1), legs)


def leg(action: LegAction, track: int, one: int, two: int, end_ms: int) -> Leg:
    return Leg(action, track, one, two, Side.NEAR, end_ms)


#: Down from floor 2, to the compartment, and up again; all of it is to be over within a minute.
DOWN_AND_UP = itinerary(
    3,
    leg(LegAction.TRAVEL, 2, 3, 0, 10_000),
    leg(LegAction.RIDE, SHAFT, 2, 1, 15_000),
    leg(LegAction.TRAVEL, 1, 0, 5, 25_000),
    leg(LegAction.TRAVEL, 1, 5, 0, 40_000),
    leg(LegAction.RIDE, SHAFT, 1, 2, 50_000),
    leg(LegAction.TRAVEL, 2, 0, 3, 60_000),
)
#: Ten years.
AGES_US = 315_576_000_000_000


def lift_at(index: int) -> Holon:
    holon = Holon(SITE, SITE.machines[LIFT], factory_for(SITE, KindCode.LIFT))
    holon.start(0)
    holon.receive(BusTime(BAY, 0), 0)
    holon.tokens.trust()
    holon.sense(PlatformState(LIFT, False, False, 0), 5)
    pitch_mm = SITE.tracks[SHAFT].pitch_mm
    holon.sense(DriveState(LIFT, 4, (index - 1) * pitch_mm, 0, DriveMode.STANDING, True), 10)
    return holon


def boards(holon: Holon, now_us: int) -> int | None:
    assert isinstance(holon.behaviour, Lift)
    ride = holon.behaviour.next_ride(now_us)
    return None if ride is None else ride.board


def test_which_ride_is_next_is_the_robots_word_whatever_the_lifts_clock_shows() -> None:
    for now_us in (0, 20_000_000, 70_000_000, 3_600_000_000, AGES_US):
        holon = lift_at(1)
        holon.mirror.on_itinerary(DOWN_AND_UP, now_us)
        assert boards(holon, now_us) == 2
        holon.mirror.on_progress(Progress(ROBOT, 3, 1, 2, 0, 0, 0))
        assert boards(holon, now_us) == 2, "it is in this ride"
        holon.mirror.on_progress(Progress(ROBOT, 3, 2, 1, 0, 0, 500))
        assert boards(holon, now_us) == 1
        holon.mirror.on_progress(Progress(ROBOT, 3, 5, 2, 0, 0, 500))
        assert boards(holon, now_us) is None


def test_a_word_about_another_plan_ends_no_ride() -> None:
    holon = lift_at(1)
    holon.mirror.on_itinerary(DOWN_AND_UP, 0)
    holon.mirror.on_progress(Progress(ROBOT, 2, 5, 2, 0, 0, 0))
    assert boards(holon, 0) == 2


def test_a_lift_says_where_it_stands_under_each_version_by_which_it_gives_its_gate() -> None:
    holon = lift_at(1)
    gives: list[Effect] = []
    for version in (1, 3):
        gives += holon.tokens.give(segment_token(gate(SHAFT)), ROBOT, 100)
        words = said(holon.behaviour.advance(200))
        assert [says_standing(m, version) for m in words if isinstance(m, Progress)] == [1]
        back = TokenGrant(ROBOT, TokenKind.SEGMENT, gate(SHAFT).number, version + 1, LIFT)
        holon.tokens.on_grant(back, 300)
    assert len(gives) == 4


def test_a_lift_whose_drive_may_still_go_gives_nothing_away() -> None:
    """Its plan has changed right after an order for another floor: the drive's last word is older than the order."""
    holon = lift_at(1)
    lift = holon.behaviour
    assert isinstance(lift, Lift)
    pitch_mm = SITE.tracks[SHAFT].pitch_mm
    assert orders(lift._go(2, 100))
    holon.mirror.on_itinerary(itinerary(3, *DOWN_AND_UP.legs[4:]), 100)
    wanted = TokenRequest(ROBOT, TokenKind.SEGMENT, platform(SHAFT).number, 0, 3, 0)
    assert lift.may_grant(segment_token(platform(SHAFT)), wanted.sender, 100) is not Reason.NONE
    lift.sense(DriveState(LIFT, lift.link.sequence, pitch_mm // 3, 200, DriveMode.MOVING, False), 200)
    assert lift.may_grant(segment_token(platform(SHAFT)), wanted.sender, 200) is not Reason.NONE
    lift.sense(DriveState(LIFT, lift.link.sequence, 0, 0, DriveMode.STANDING, True), 300)
    assert lift.may_grant(segment_token(platform(SHAFT)), wanted.sender, 300) is Reason.NONE

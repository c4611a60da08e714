"""A place is one robot's: who has lost its place to another leaves its car elsewhere, and nobody brings a second."""

from onboard.contract.codes import Grade, KindCode, LegAction, Reason, ShuttleMode
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import CarAt, Itinerary, Progress, Reference, Stamp
from onboard.core.authority import station_token
from onboard.core.effects import Record
from onboard.core.serial import BUS_MS_MODULUS
from onboard.core.site import Station
from onboard.holon.holon import Holon
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.program import CarHandling, CarStep, StationWork, to_itinerary
from onboard.systems.car_park.recovery import JournalRecovery
from onboard.systems.registry import factory_for
from onboard.ways.tokens import car_token
from tests.kinds.board import AWARDED, CALL, OTHER, PLACE, ROBOT, SITE, STEWARD, TAKEN, TASK, Board

#: When a robot that was started again goes on, us.
GOES_ON_US = 3_000_000
RIVAL = Reference(STEWARD, 2)


def carrying() -> Board:
    """A car is aboard for PLACE, and the way there is planned."""
    board = Board(*AWARDED, TAKEN)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME, load_kg=1_400)
    board.lives(GOES_ON_US)
    assert places_of(board.plans[-1]) == [PLACE]
    return board


def places_of(plan: Itinerary) -> list[Station]:
    return [Station(leg.track, leg.to_index, leg.side) for leg in plan.legs if leg.action is LegAction.WORK]


def rival(stamp_ms: int) -> Itinerary:
    """The other brings its car to the same place."""
    work = StationWork(CarHandling.LEAVE, PLACE, RIVAL, 2_700, CALL)
    at = PLACE.index
    steps = [
        CarStep(LegAction.TRAVEL, 1, 11, at, 60_000_000, 70_000_000),
        CarStep(LegAction.WORK, 1, at, at, 70_000_000, 90_000_000, work),
        CarStep(LegAction.TRAVEL, 1, at, 12, 90_000_000, 99_000_000),
    ]
    return to_itinerary(OTHER, 1, Grade.FIRM, Stamp(stamp_ms, OTHER, 0), steps)


def test_of_two_plans_for_one_place_the_lower_stamp_keeps_it() -> None:
    board = carrying()
    board.hears(rival(stamp_ms=0))
    board.lives(board.now_us + 1)
    (place,) = places_of(board.plans[-1])
    assert place != PLACE
    sinks = [dict(one.entry) for one in board.said if isinstance(one, Record) and one.entry.get("record") == "sink"]
    assert [one["station"] for one in sinks] == [place.number]
    works = JournalRecovery.read(ROBOT, [*AWARDED, TAKEN, *sinks]).works
    assert [work.station for work in works] == [place], "so it is after another restart"


def test_a_stamp_of_before_the_wrap_of_bus_time_is_the_lower_one() -> None:
    board = carrying()
    board.hears(rival(stamp_ms=BUS_MS_MODULUS - 1_000))
    board.lives(board.now_us + 1)
    assert PLACE not in places_of(board.plans[-1])


def test_the_older_plan_stays_where_it_is() -> None:
    board = carrying()
    board.hears(rival(stamp_ms=500_000))
    board.lives(board.now_us + 1)
    assert places_of(board.plans[-1]) == [PLACE]


def test_work_that_is_behind_another_promises_no_place() -> None:
    """A robot that has had nothing to do since keeps its last plan."""
    board = carrying()
    leave = StationWork(CarHandling.LEAVE, PLACE, RIVAL, 2_700, CALL)
    over = CarStep(LegAction.WORK, 1, PLACE.index, PLACE.index, -81_000_000, -80_000_000, leave)
    goes = CarStep(LegAction.TRAVEL, 1, PLACE.index, 12, -80_000_000, -79_000_000)
    plan = to_itinerary(OTHER, 1, Grade.FIRM, Stamp(BUS_MS_MODULUS - 90_000, OTHER, 0), [over, goes])
    before = len(board.plans)
    board.hears(Progress(OTHER, 1, 1, 1, 12, 0, 0), plan)
    board.lives(board.now_us + 1)
    assert {(PLACE,)} == {tuple(places_of(one)) for one in board.plans[before - 1 :]}


def test_who_finds_no_place_that_is_not_promised_keeps_its_own_and_goes_to_and_fro_between_none() -> None:
    """Late work keeps a place for its robot, and keeps nobody from choosing it: robots of `large` halted by that."""
    board = carrying()
    leave = StationWork(CarHandling.LEAVE, PLACE, RIVAL, 2_700, CALL)
    late = [
        CarStep(LegAction.WORK, 1, place.index, place.index, -81_000_000, -80_000_000, leave._replace(station=place))
        for place in SITE.places
    ]
    before = len(board.plans)
    board.hears(to_itinerary(OTHER, 1, Grade.FIRM, Stamp(BUS_MS_MODULUS - 90_000, OTHER, 0), late))
    board.lives(board.now_us + 1)
    assert {(PLACE,)} == {tuple(places_of(one)) for one in board.plans[before - 1 :]}


def test_a_place_in_which_another_car_is_put_meanwhile_is_lost() -> None:
    board = carrying()
    board.hears(CarAt(STEWARD, RIVAL, PLACE.number, 3, 2_700))
    board.lives(board.now_us + 1)
    assert places_of(board.plans[-1]) != [PLACE]


def test_a_steward_gives_the_right_to_a_place_with_a_car_to_nobody_who_brings_another() -> None:
    steward = Holon(SITE, SITE.machines[STEWARD], factory_for(SITE, KindCode.COMPARTMENT), boot=1)
    steward.start(0)
    key = station_token(PLACE)
    assert steward.behaviour.may_grant(key, ROBOT, 0) is Reason.NONE
    steward.receive(CarAt(OTHER, TASK, PLACE.number, 2, 2_700), 0)
    assert steward.behaviour.may_grant(key, ROBOT, 0) is Reason.TOKEN_NOT_GRANTABLE_YET


def test_a_steward_gives_the_right_to_a_car_that_has_left_to_nobody() -> None:
    steward = Holon(SITE, SITE.machines[STEWARD], factory_for(SITE, KindCode.COMPARTMENT), boot=1)
    steward.start(0)
    assert isinstance(steward.behaviour, Compartment)
    steward.behaviour.stewardship.winners[TASK] = ROBOT
    steward.receive(CarAt(OTHER, TASK, PLACE.number, 2, 2_700), 0)
    assert steward.behaviour.may_grant(car_token(*TASK), ROBOT, 0) is Reason.NONE
    steward.receive(CarAt(OTHER, TASK, OUTSIDE, 3, 2_700), 0)
    assert steward.behaviour.may_grant(car_token(*TASK), ROBOT, 0) is Reason.TOKEN_NOT_GRANTABLE_YET

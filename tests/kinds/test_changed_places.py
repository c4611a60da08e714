"""Two robots fetch for one bay: whichever stands before it with its car is served first, whoever was called first."""

import pytest

from onboard.contract.codes import DoorAction, DoorName, DoorPosition, LightColour, Operation
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import BayState, CarAt, DoorOrder, DoorState, Reference, TokenGrant, TokenRequest
from onboard.core.authority import segment_token, station_token
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.journal_records import JournalRecord
from onboard.core.site import Segment
from onboard.systems.car_park.bay_memory import BayMemory, ahead_record, job_record
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from tests.kinds.board import taking_part
from tests.sites import one_floor

SITE = one_floor(robots=2)
BAY, CAR, OTHER = 1, Reference(1, 7), Reference(1, 8)
WHEELBASE_MM = 2_700
OPENS = DoorName.OUTPUT, DoorAction.OPEN
FIRST, SECOND = Reference(BAY, 77), Reference(BAY, 78)
SLOW, FAST = 11, 12
BEFORE = (job_record(FIRST, Operation.RETRIEVE, CAR, WHEELBASE_MM), ahead_record(SECOND, OTHER, WHEELBASE_MM))


class Bay:
    """Empty, locked on both sides, and waiting for the first of two cars."""

    def __init__(self) -> None:
        self.holon = taking_part(SITE, BAY)
        self.now_us = 1_000
        for node, car, place in ((SLOW, CAR, SITE.places[0]), (FAST, OTHER, SITE.places[1])):
            self.holon.receive(CarAt(node, car, place.number, 2, WHEELBASE_MM), self.now_us)
        assert isinstance(self.holon.behaviour, Compartment)
        self.behaviour = self.holon.behaviour
        self.doors(DoorPosition.LOCKED)
        self.holon.sense(BayState(BAY, 0, 0, 0, 0, False, False, 0), self.now_us)
        calls = self.behaviour.calls
        calls.job = BayTask(FIRST, Operation.RETRIEVE, CAR, WHEELBASE_MM, winner=SLOW)
        calls.ahead = BayTask(SECOND, Operation.RETRIEVE, OTHER, WHEELBASE_MM, winner=FAST)
        self.behaviour.phase = BayPhase.AWAITING

    def doors(self, output: DoorPosition) -> list[Effect]:
        return self.holon.sense(DoorState(BAY, DoorPosition.LOCKED, output, LightColour.RED), self.now_us)

    def comes(self, robot: int) -> None:
        """It gets the right to the slot in front of the bay, which one robot has at a time."""
        key = segment_token(Segment(self.behaviour.station.track, self.behaviour.station.index))
        assert granted(self.holon.receive(TokenRequest(robot, key.kind, key.number, 0, 0, 0), self.now_us)) == [robot]

    def loads(self, robot: int, car: Reference) -> None:
        self.holon.receive(CarAt(robot, car, ANY_STATION, 3, WHEELBASE_MM), self.now_us)

    def asks(self, robot: int) -> list[Effect]:
        """A robot stands before it."""
        key = station_token(self.behaviour.station)
        self.now_us += 500_000
        return self.holon.receive(TokenRequest(robot, key.kind, key.number, 0, 1, 0), self.now_us)


def opens(effects: list[Effect]) -> bool:
    orders = [one.message for one in effects if isinstance(one, Actuate)]
    return any(isinstance(one, DoorOrder) and (one.door, one.action) == OPENS for one in orders)


def granted(effects: list[Effect]) -> list[int]:
    said = [one.message for one in effects if isinstance(one, Send)]
    return [one.holder for one in said if isinstance(one, TokenGrant)]


def records(effects: list[Effect]) -> list[JournalRecord]:
    return [one.what for one in effects if isinstance(one, Record)]


def test_the_car_that_is_there_first_goes_out_first_and_then_the_other() -> None:
    """On a drawn site (3565) the second came before the first: neither could go on, and one was told for false."""
    bay = Bay()
    bay.loads(FAST, OTHER)
    bay.comes(FAST)
    noted = bay.asks(FAST)
    assert opens(noted) and not granted(noted)
    bay.doors(DoorPosition.OPEN)
    assert granted(bay.asks(FAST)) == [FAST] and not granted(bay.asks(SLOW))
    read = BayMemory(BAY).take_up([*(one.what for one in BEFORE), *records(noted)])
    assert read.job is not None and (read.job[0], read.ahead) == (SECOND, (FIRST, CAR, WHEELBASE_MM))


@pytest.mark.parametrize(("comes", "is_loaded"), [(False, True), (True, False)], ids=["not there", "with nothing"])
def test_a_robot_that_is_not_there_or_brings_nothing_goes_before_nobody(comes: bool, is_loaded: bool) -> None:
    """Who had asked for the bay once went before another, and stood behind it (`compare standard`, random, seed 6)."""
    bay = Bay()
    bay.loads(SLOW, CAR)
    if is_loaded:
        bay.loads(FAST, OTHER)
    bay.comes(FAST if comes else SLOW)
    assert not opens(bay.asks(FAST))
    assert opens(bay.asks(SLOW))
    bay.doors(DoorPosition.OPEN)
    assert granted(bay.asks(SLOW)) == [SLOW] and not granted(bay.asks(FAST))


def test_a_bay_that_is_open_for_a_robot_that_went_takes_the_other() -> None:
    bay = Bay()
    bay.loads(SLOW, CAR)
    bay.loads(FAST, OTHER)
    assert opens(bay.asks(SLOW))
    bay.doors(DoorPosition.OPEN)
    bay.comes(FAST)
    bay.asks(FAST)
    assert granted(bay.asks(FAST)) == [FAST]


def test_a_robot_that_has_both_brings_them_in_either_order() -> None:
    bay = Bay()
    assert bay.behaviour.calls.job is not None
    bay.behaviour.calls.job.winner = FAST
    bay.loads(FAST, OTHER)
    bay.comes(FAST)
    assert opens(bay.asks(FAST))

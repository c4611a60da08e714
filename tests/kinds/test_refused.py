"""A shuttle that was sent out just as its carrier was pushed off the mark: its drive refuses, and nothing is broken."""

import pytest

from onboard.contract.codes import (
    Criterion,
    DriveMode,
    KindCode,
    Operation,
    ShuttleAction,
    ShuttleMode,
    Side,
    TokenKind,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    CallForProposals,
    CarAt,
    DriveOrder,
    Reference,
    ShuttleOrder,
    ShuttleState,
    TokenGrant,
)
from onboard.core.authority import TokenKey, station_token
from onboard.core.effects import Actuate, Effect
from onboard.core.site import Station
from onboard.systems.car_park.handling import ShuttleWork, handle
from onboard.systems.car_park.program import CarHandling, HandlingPhase, StationWork
from onboard.systems.car_park.travel import Carriage
from onboard.ways.tokens import car_token
from tests.kinds.test_turning import MOUTH, MOUTH_MM, PITCH_MM, ROBOT, STEWARD, carriage, get, state

#: Beside the mark where the carrier stands, and what stands there.
PLACE, CAR = Station(MOUTH.track, MOUTH.index, Side.NEAR), Reference(STEWARD, 1)
TASK = CallForProposals(
    STEWARD,
    1,
    Reference(STEWARD, 2),
    Operation.PARK,
    KindCode.ROBOT,
    Criterion.FINISH_TIME,
    1,
    0,
    0,
    PLACE.number,
    ANY_STATION,
    CAR,
    2_500,
)


def sent(effects: list[Effect]) -> list[ShuttleAction | int]:
    """Orders to the shuttle, and where the drive is sent, mm."""
    found: list[ShuttleAction | int] = []
    for message in (one.message for one in effects if isinstance(one, Actuate)):
        if isinstance(message, ShuttleOrder):
            found.append(message.action)
        elif isinstance(message, DriveOrder):
            found.append(message.target_mm)
    return found


def shuttle(mode: ShuttleMode, sequence: int, extension_mm: int = 0) -> ShuttleState:
    return ShuttleState(ROBOT, sequence, mode, extension_mm, Side.NEAR, 0, 2_500)


def has(one: Carriage, key: TokenKey) -> None:
    one.fleet.tokens.on_grant(TokenGrant(STEWARD, key.kind, key.number, 1, ROBOT), 0)


@pytest.fixture
def pair() -> tuple[Carriage, ShuttleWork]:
    """It stands at the mark with all rights, and has sent its shuttle out for the car."""
    one = carriage()
    work = ShuttleWork(one.fleet, at_mark=lambda: one.arrived)
    one.is_clear = lambda: work.is_home
    one.sense(state(MOUTH_MM), 0)
    work.sense(shuttle(ShuttleMode.HOME, 0), 0)
    one.go(MOUTH)
    get(one, MOUTH)
    has(one, station_token(PLACE))
    one.fleet.mirror.on_car(CarAt(STEWARD, CAR, PLACE.number, 1, 2_500))
    has(one, car_token(*CAR))
    one.advance(0)
    work.begin(StationWork(CarHandling.TAKE, PLACE, CAR, 2_500, TASK))
    assert sent(handle(one, work, 1)) == [ShuttleAction.REACH]
    return one, work


def test_pushed_as_it_reached_out_it_goes_back_to_the_mark_and_begins_anew(pair: tuple[Carriage, ShuttleWork]) -> None:
    """It stood for a person to come, beside the bay, and that was out of order too (branch, pushes, seed 50404)."""
    one, work = pair
    one.sense(state(MOUTH_MM + 100, sequence=one.sequence), 2)
    assert sent(work.sense(shuttle(ShuttleMode.FAULT, work.sequence), 3)) == [ShuttleAction.RETRACT]
    assert (work.fault, work.is_out, sent(handle(one, work, 3))) == (False, True, [])
    work.sense(shuttle(ShuttleMode.HOME, work.sequence), 4)
    assert (work.phase, sent(handle(one, work, 4))) == (HandlingPhase.ACQUIRE, [])
    has(one, TokenKey(TokenKind.SEGMENT, MOUTH._replace(index=MOUTH.index + 1).number))
    assert sent(handle(one, work, 5)) == [MOUTH_MM]
    one.sense(state(MOUTH_MM, sequence=one.sequence), 6)
    assert sent(handle(one, work, 6)) == [ShuttleAction.REACH]


def test_pushed_to_another_mark_as_it_reached_out_it_takes_its_shuttle_in_and_goes_back(
    pair: tuple[Carriage, ShuttleWork],
) -> None:
    """Its drive saw a mark, and did not refuse: it stood there with its shuttle out for good (drawn car park 4698)."""
    one, work = pair
    one.sense(state(MOUTH_MM + PITCH_MM, sequence=one.sequence), 2)
    work.sense(shuttle(ShuttleMode.MOVING, work.sequence, 900), 3)
    assert sent(handle(one, work, 3)) == []
    work.sense(shuttle(ShuttleMode.REACHED, work.sequence, 1_000), 4)
    assert sent(handle(one, work, 4)) == [ShuttleAction.RETRACT]
    assert sent(handle(one, work, 5)) == []
    work.sense(shuttle(ShuttleMode.HOME, work.sequence), 6)
    has(one, TokenKey(TokenKind.SEGMENT, MOUTH._replace(index=MOUTH.index + 1).number))
    assert sent(handle(one, work, 7)) == [MOUTH_MM]
    one.sense(state(MOUTH_MM, sequence=one.sequence), 8)
    assert sent(handle(one, work, 8)) == [ShuttleAction.REACH]


def test_its_drive_says_once_more_that_it_refused(pair: tuple[Carriage, ShuttleWork]) -> None:
    one, work = pair
    refused = shuttle(ShuttleMode.FAULT, work.sequence)
    one.sense(state(MOUTH_MM + 100, sequence=one.sequence), 2)
    work.sense(refused, 3)
    work.sense(refused, 4)
    assert not work.fault
    work.sense(shuttle(ShuttleMode.FAULT, work.sequence), 5)
    assert work.fault, "it does not come home"


@pytest.mark.parametrize(("by_mm", "out_mm"), [(0, 0), (100, 40)])
def test_at_the_mark_or_once_it_is_out_it_is_a_fault(
    pair: tuple[Carriage, ShuttleWork], by_mm: int, out_mm: int
) -> None:
    one, work = pair
    one.sense(state(MOUTH_MM + by_mm, DriveMode.STANDING, sequence=one.sequence), 2)
    assert sent(work.sense(shuttle(ShuttleMode.FAULT, work.sequence, out_mm), 3)) == []
    assert work.fault

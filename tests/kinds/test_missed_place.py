"""A robot says where it leaves a car, and its keeper misses that: it learns the place from later words."""

import pytest

from onboard.contract.codes import CallResult, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Award, CarAt, Message, TaskReport, TokenGrant, TokenHeld, TokenRequest
from onboard.systems.car_park.bay_task import BayPhase
from onboard.systems.car_park.compartment import Compartment
from tests.kinds.test_whose_task import after_a_while
from tests.models.at_work import AtWork
from tests.models.award import BAY, CAR, CHEAP, KEY, PLACE, TASK, WHEELBASE_MM
from tests.models.custody import HERE
from tests.models.parking import Felt, ParkingPart

DONE = TaskReport(CHEAP, TASK, TaskPhase.DONE, PLACE.number, Reason.NONE)
BROUGHT = TokenGrant(CHEAP, KEY.kind, KEY.number, 3, BAY)
BAY_BACK = TokenGrant(CHEAP, TokenKind.STATION, HERE.number, 2, BAY)


def has(kind: TokenKind, number: int, version: int) -> list[Message]:
    """The robot asks for a right of the keeper, and has it."""
    return [TokenRequest(CHEAP, kind, number, version - 1, 2, 0), TokenHeld(CHEAP, kind, number, version)]


def phase(machine: AtWork) -> BayPhase:
    assert isinstance(machine.behaviour, Compartment)
    return machine.behaviour.phase


@pytest.fixture
def keeper() -> AtWork:
    """Of bay and place; its robot has taken the car out of the one: all that it heard of it is where it was before."""
    part = ParkingPart()
    made: AtWork = part.made(BAY, part.journal(BAY), part.body(BAY))
    made.starts()
    for _ in range(2):
        made, _ = after_a_while(made)
    bay, place = has(TokenKind.STATION, HERE.number, 1), has(TokenKind.STATION, PLACE.number, 1)
    for word in (*bay, *bay, *has(KEY.kind, KEY.number, 2), CarAt(CHEAP, CAR, HERE.number, 2, WHEELBASE_MM), *place):
        made.hears(word)
    assert made.fleet.tokens.holder_of(KEY) == CHEAP
    return made


def test_who_brought_a_car_says_where_it_is_once_more(keeper: AtWork) -> None:
    """The car would have been called for out of the bay, in which it was no more, whenever its customer came."""
    assert CarAt(BAY, CAR, HERE.number, 3, WHEELBASE_MM) in keeper.hears(BROUGHT)
    assert CarAt(BAY, CAR, PLACE.number, 3, WHEELBASE_MM) in keeper.hears(DONE)


def test_a_car_that_is_in_the_bay_no_more_is_asked_for(keeper: AtWork) -> None:
    """``DONE`` was missed as well: a robot answers an award that is said again with how its task stands."""
    keeper.meets(Felt(0))
    keeper.hears(BROUGHT)
    assert Award(BAY, 0, CHEAP, TASK, 1, CallResult.AWARDED, Reason.NONE) in keeper.hears(BAY_BACK)


def test_a_bay_whose_sensors_are_behind_is_free_once_its_car_stands_elsewhere(keeper: AtWork) -> None:
    """It took the car for one that nobody had fetched yet, and waited for a robot for ever."""
    for word in (BROUGHT, BAY_BACK, DONE):
        keeper.hears(word)
    assert phase(keeper) is BayPhase.AWAITING
    keeper.meets(Felt(0))
    keeper.waits(())
    assert phase(keeper) is BayPhase.FREE
    record = keeper.fleet.mirror.cars[CAR]
    assert (record.custodian, record.station) == (BAY, PLACE.number), "it has not left"


def test_a_car_that_is_aboard_is_taken_only_once_its_place_is_heard(keeper: AtWork) -> None:
    keeper.hears(CarAt(CHEAP, CAR, ANY_STATION, 2, WHEELBASE_MM))
    assert not [deed for deed in keeper.hears(BROUGHT) if isinstance(deed, (CarAt, TokenHeld))]
    keeper.hears(CarAt(CHEAP, CAR, PLACE.number, 2, WHEELBASE_MM))
    assert CarAt(BAY, CAR, PLACE.number, 3, WHEELBASE_MM) in keeper.hears(BROUGHT)

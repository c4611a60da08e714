"""Whose word about a car counts: that of who has its token, mine first of all."""

import pytest

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import BusTime, CarAt, Message, Reference, TokenGrant, TokenHeld
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.ways.mirror import way_mirror
from onboard.ways.tokens import car_token
from tests.sites import one_floor

SITE = one_floor(robots=2)
BAY, ROBOT, LIAR = 1, 11, 12
CAR = Reference(BAY, 1)
NUMBER = car_token(*CAR).number
HERE, THERE = SITE.places[0].number, SITE.places[1].number


def at(sender: int, station: int, version: int) -> CarAt:
    return CarAt(sender, CAR, station, version, 2_600)


def hears(node: int, *words: Message) -> Holon:
    made = Holon(SITE, SITE.machines[node], factory_for(SITE, SITE.machines[node].kind))
    made.start(0)
    if node != BAY:
        made.receive(BusTime(BAY, 0), 0)
    for at_us, word in enumerate(words, start=1):
        made.receive(word, at_us)
    return made


def test_where_my_car_is_nobody_else_says() -> None:
    bay = hears(BAY)
    bay.tokens.create(car_token(*CAR))
    way_mirror(bay.mirror).on_car(at(BAY, HERE, 1))
    for version in (1, 2, 9):
        bay.receive(at(LIAR, THERE, version), 10)
    assert way_mirror(bay.mirror).cars[CAR].station == HERE
    assert bay.drops[Reason.RIGHT_CLAIMED] == 3


def test_a_word_of_somebody_else_than_the_custodian_comes_to_nothing() -> None:
    robot = hears(ROBOT, at(BAY, HERE, 1), at(LIAR, THERE, 2))
    assert way_mirror(robot.mirror).cars[CAR].station == HERE
    assert robot.drops[Reason.NOT_THE_HOLDER] == 1


@pytest.mark.parametrize(
    "proof",
    [TokenGrant(BAY, TokenKind.CAR, NUMBER, 2, LIAR), TokenHeld(LIAR, TokenKind.CAR, NUMBER, 2)],
    ids=["grant", "held"],
)
@pytest.mark.parametrize("is_before", [True, False], ids=["before the word", "after the word"])
def test_the_tokens_move_proves_the_word_of_its_taker(proof: Message, is_before: bool) -> None:
    """Frames can be lost or come late: a word that came first is taken up when its proof is heard."""
    word = at(LIAR, ANY_STATION, 2)
    robot = hears(ROBOT, at(BAY, HERE, 1), *((proof, word) if is_before else (word, proof)))
    assert (way_mirror(robot.mirror).cars[CAR].station, way_mirror(robot.mirror).cars[CAR].custodian) == (
        ANY_STATION,
        LIAR,
    )


def test_whose_journal_has_lost_where_its_car_stands_hears_it_from_who_gave_it() -> None:
    """The giver says so until it has heard the taker: an unmeasured car has its wheelbase from that alone."""
    robot = hears(ROBOT)
    robot.tokens.held[car_token(*CAR)] = robot.tokens.seen[car_token(*CAR)] = 2
    robot.receive(at(LIAR, THERE, 9), 10)
    assert CAR not in way_mirror(robot.mirror).cars
    robot.receive(at(BAY, HERE, 1), 11)
    robot.receive(at(LIAR, THERE, 1), 12)
    known = way_mirror(robot.mirror).cars[CAR]
    assert (known.station, known.custodian, known.wheelbase_mm) == (HERE, BAY, 2_600)

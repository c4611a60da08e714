"""Where a car stands that is mine now, as its giver says again until it has heard me."""

from collections import Counter

from bus_sim.sites import find_site
from onboard.contract.codes import Reason
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CarAt, Reference
from onboard.core.authority import TokenBook
from onboard.ways.cars import CarMirror
from onboard.ways.tokens import car_token

SITE = find_site("terminal")
DESK, ROBOT, CAR, PLACE = 1, 11, Reference(1, 16), 20


def keeper(*words: CarAt) -> CarMirror:
    """A desk that has taken a car's token from the robot under version 2, with what it heard of the car until then."""
    mirror, drops = CarMirror(SITE, DESK), Counter[Reason]()
    tokens = TokenBook(SITE, DESK)
    mirror.joins(tokens, drops)
    for word in words:
        mirror.handlers()[CarAt](word, 0)
    tokens.held[car_token(*CAR)] = 2
    return mirror


def said(station: int, version: int = 1, sender: int = ROBOT) -> CarAt:
    return CarAt(sender, CAR, station, version, 0)


def test_words_of_one_version_that_came_in_another_order_are_put_right() -> None:
    """A terminal drawn by chance: the desk had the box for good, and believed it aboard the robot that had left it."""
    mirror = keeper(said(PLACE), said(ANY_STATION))
    mirror.handlers()[CarAt](said(PLACE), 0)
    assert mirror.cars[CAR].station == PLACE


def test_nobody_else_and_no_other_version_moves_a_car_that_is_mine() -> None:
    for word in (said(PLACE, sender=12), said(PLACE, version=3), said(PLACE, version=2)):
        mirror = keeper(said(ANY_STATION))
        mirror.handlers()[CarAt](word, 0)
        assert mirror.cars[CAR].station == ANY_STATION
    mirror = keeper(said(PLACE))
    mirror.handlers()[CarAt](said(21), 0)
    assert mirror.cars[CAR].station == PLACE, "a place is not moved by who had it"

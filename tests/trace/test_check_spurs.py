"""Authority and bodies at the mouths of spurs, from frames alone."""

import pytest

from onboard.config.site import parse_site
from onboard.contract.codes import DriveMode
from onboard.contract.messages import DriveOrder, DriveState, Message
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark, car_park
from tests.sites import ONE_FLOOR
from tests.trace.checking import MR1, MR2, Tape, at, grant

MOUTH, INSIDE = Segment(1, 7), Segment(192, 1)


def site() -> CarPark:
    """One alley of 12 with a spur at p(1,7), robots at home on p(1,12) and p(1,11)."""
    robots = "".join(f'[[robots]]\nname = "MR{n}"\nnode = {10 + n}\nhome = "p(1,{13 - n})"\n' for n in (1, 2))
    return car_park(
        parse_site(ONE_FLOOR.format(positions=12) + '[[spurs]]\nat = "p(1,7)"\n' + robots, "t.toml", crowded=True)
    )


def state(position_mm: int, *, across: bool) -> DriveState:
    return DriveState(MR1, 1, position_mm, 0, DriveMode.STANDING, True, across)


def sent(target_mm: int, *, across: bool) -> DriveOrder:
    return DriveOrder(MR1, 1, target_mm, 1500, across)


TAKEN = [grant(MOUTH, 1, 1, MR1), grant(INSIDE, 1, 1, MR1)]
AT_MOUTH: list[Message] = [at(MR1, 1, 7), state(6 * 2_400, across=False), sent(0, across=True)]
TURNED: list[Message] = [at(MR1, 192, 0), state(-2_400, across=True), sent(0, across=True)]
IN: list[Message] = [at(MR1, 192, 1), state(0, across=True)]
OUT: list[Message] = [*IN, sent(-2_400, across=True), at(MR1, 192, 0), state(-2_400, across=True)]
BACK: list[Message] = [*OUT, sent(6 * 2_400, across=False), at(MR1, 1, 7)]


@pytest.mark.parametrize("messages", [AT_MOUTH, AT_MOUTH + TURNED + IN, BACK], ids=["turn", "in", "out"])
def test_turning_is_right_with_mouth_and_spur_held(messages: list[Message]) -> None:
    assert Tape(site()).say(1, *TAKEN, *messages).broken() == {}


def test_in_the_spur_its_own_slot_is_enough() -> None:
    tape = Tape(site()).say(1, *TAKEN, *AT_MOUTH, *TURNED, *IN)
    assert tape.say(2, grant(MOUTH, 2, MR1, 1)).say(4, *IN).broken() == {}


@pytest.mark.parametrize("messages", [AT_MOUTH, TURNED, OUT], ids=["sent to turn", "turned", "sent out"])
@pytest.mark.parametrize("held", [MOUTH, INSIDE], ids=["mouth", "spur"])
def test_with_one_of_the_two_it_is_not(messages: list[Message], held: Segment) -> None:
    assert "inside-authority" in Tape(site()).say(1, grant(held, 1, 1, MR1), *messages).broken()


def test_two_bodies_in_a_mouth_are_found() -> None:
    broken = Tape(site()).say(1, *TAKEN, at(MR1, 192, 0)).say(2, at(MR2, 1, 7, 300)).broken()
    assert broken["one-body"] == 1


def test_a_body_in_the_spur_lets_others_pass() -> None:
    tape = Tape(site()).say(1, *TAKEN, *IN).say(2, grant(MOUTH, 2, MR1, 1), grant(MOUTH, 3, 1, MR2))
    assert tape.say(3, at(MR2, 1, 7)).broken() == {}

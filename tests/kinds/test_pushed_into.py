"""Who was pushed by hand into a slot gets the right to it, and nobody else comes there until it has gone."""

import pytest

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.messages import Progress, TokenGrant, TokenHeld, TokenRefusal, TokenRequest
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from tests.kinds.board import taking_part
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, PUSHED, OTHER = 1, 11, 12
INDEX = 8
#: A plan of this version was told to nobody; 0 asks without an order.
UNTOLD, UNORDERED = 5, 0


class Steward:
    """A compartment that holds the slots of its alley, with robots that say where they are and ask."""

    def __init__(self) -> None:
        self.holon = taking_part(SITE, STEWARD)
        self.now_us = 1_000

    def hears(self, robot: int, offset_mm: int, speed_mm_s: int = 0) -> None:
        self.holon.receive(Progress(robot, 1, 0, 1, INDEX, offset_mm, speed_mm_s), self.now_us)

    def asks(self, robot: int, index: int, version: int = UNORDERED) -> Reason:
        """What it is answered; NONE where it is granted."""
        self.now_us += 10_000_000
        slot = Segment(1, index).number
        effects = self.holon.receive(TokenRequest(robot, TokenKind.SEGMENT, slot, 0, version, 0), self.now_us)
        return answer([*effects, *self.holon.wake(self.now_us)], slot, robot)

    def comes_back(self, robot: int, index: int) -> None:
        """The robot holds what was granted to it, and gives it back."""
        slot = Segment(1, index).number
        for said in (
            TokenHeld(robot, TokenKind.SEGMENT, slot, 1),
            TokenGrant(robot, TokenKind.SEGMENT, slot, 2, STEWARD),
        ):
            self.holon.receive(said, self.now_us)


def answer(effects: list[Effect], slot: int, robot: int) -> Reason:
    said = [one.message for one in effects if isinstance(one, Send)]
    if any(isinstance(one, TokenGrant) and (one.token, one.holder) == (slot, robot) for one in said):
        return Reason.NONE
    return next(
        one.reason for one in said if isinstance(one, TokenRefusal) and (one.token, one.requester) == (slot, robot)
    )


def test_a_slot_in_which_another_stands_by_half_goes_to_that_one_only() -> None:
    """It was pushed, had no right to it and no plan there; another was let in and came 1.8 m close."""
    steward = Steward()
    steward.hears(PUSHED, 600)
    assert steward.asks(OTHER, INDEX + 1) is Reason.TOKEN_NOT_GRANTABLE_YET
    assert steward.asks(PUSHED, INDEX + 1, UNTOLD) is Reason.NONE
    steward.hears(PUSHED, 0)
    steward.comes_back(PUSHED, INDEX + 1)
    assert steward.asks(OTHER, INDEX + 1) is Reason.NONE


@pytest.mark.parametrize(
    ("offset_mm", "speed_mm_s"), [(5, 0), (-600, 0), (600, 500)], ids=["on its mark", "on the other side", "goes on"]
)
def test_beside_a_body_that_is_not_in_it_a_slot_is_granted(offset_mm: int, speed_mm_s: int) -> None:
    steward = Steward()
    steward.hears(PUSHED, offset_mm, speed_mm_s)
    assert steward.asks(OTHER, INDEX + 1) is Reason.NONE


def test_who_gave_a_slot_back_is_not_in_it_though_the_word_that_said_so_was_lost() -> None:
    steward = Steward()
    steward.hears(PUSHED, 600)
    assert steward.asks(PUSHED, INDEX + 1, UNTOLD) is Reason.NONE
    steward.comes_back(PUSHED, INDEX + 1)
    assert steward.asks(OTHER, INDEX + 1) is Reason.NONE

"""A robot whose plan changes while it waits for rights, or while it drives."""

from onboard.contract.codes import DriveMode, TokenKind
from onboard.contract.messages import DriveState, TokenGrant
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.systems.car_park.travel import Carriage
from tests.kinds.test_turning import PITCH_MM, ROBOT, carriage, get, orders

#: Where it began, by the site file: it was never there.
HOME = 12


def driving(index: int, speed_mm_s: int, sequence: int) -> DriveState:
    return DriveState(ROBOT, sequence, (index - 1) * PITCH_MM, speed_mm_s, DriveMode.MOVING, False, False)


def given(effects: list[Effect]) -> set[int]:
    told = [one.message for one in effects if isinstance(one, Send) and isinstance(one.message, TokenGrant)]
    indices = {one.token & 0xFF for one in told if one.token_kind is TokenKind.SEGMENT}
    return indices - {HOME}


def sent_to_6() -> Carriage:
    """It drives from p(1,2) to p(1,6), which it holds with all between."""
    one = carriage()
    one.sense(DriveState(ROBOT, 1, PITCH_MM, 0, DriveMode.STANDING, True, False), 0)
    one.go(Segment(1, 6))
    one.advance(0)
    for index in range(2, 7):
        get(one, Segment(1, index))
    assert orders(one.advance(0)) == [(5 * PITCH_MM, False)]
    return one


def test_who_drives_keeps_the_slots_up_to_where_it_was_sent_when_its_way_leads_elsewhere() -> None:
    one = sent_to_6()
    one.sense(driving(3, 1_500, one.sequence), 1_000)
    one.go(Segment(1, 1))
    get(one, Segment(1, 1))
    assert orders(one.advance(1_000)) == [(0, False)]
    # It has not heard that yet.
    assert given(one.advance(2_000)) == set()


def test_who_was_turned_back_keeps_the_slots_in_which_it_brakes() -> None:
    one = sent_to_6()
    one.sense(driving(3, 1_500, one.sequence), 1_000)
    one.go(Segment(1, 1))
    get(one, Segment(1, 1))
    assert orders(one.advance(1_000)) == [(0, False)]
    one.sense(driving(3, 1_500, one.sequence), 2_000)
    # 1,500 mm/s at 500 mm/s2 are 2,250 mm: the next slot, and not the one after it.
    effects = one.advance(2_000)
    left = {slot.index for slot in one.left.slots} - {HOME}
    assert given(effects) | left == {5, 6}, "given, or left to who asks"

"""Who moves on tracks says where it is where it stops, before it gives back what it left, and now and then."""

from onboard.contract.codes import DriveMode, TokenKind
from onboard.contract.messages import DriveState, Progress, TokenGrant
from onboard.core.authority import segment_token
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.stall import PLACE_US
from onboard.systems.car_park.travel import Carriage
from onboard.ways.lifts import gate
from tests.kinds.test_sill import LIFT, SHAFT, SITE, lift_at
from tests.kinds.test_sill import ROBOT as RIDER
from tests.kinds.test_turned_away import driving, given, sent_to_6
from tests.kinds.test_turning import PITCH_MM, ROBOT, places


def comes_to(one: Carriage, index: int, now_us: int) -> list[tuple[int, int, int]]:
    return places(one.sense(driving(index, 1_500, one.sequence), now_us))


def test_a_run_is_told_at_its_first_border_again_after_a_while_and_where_it_ends() -> None:
    one = sent_to_6()
    assert comes_to(one, 2, 1) == [], "it has only set off"
    assert comes_to(one, 3, 2) == [(1, 3, 0)]
    assert comes_to(one, 4, PLACE_US) == []
    assert comes_to(one, 5, PLACE_US + 2) == [(1, 5, 0)]
    standing = DriveState(ROBOT, one.sequence, 4 * PITCH_MM + 300, 0, DriveMode.STANDING, False, False)
    assert places(one.sense(standing, PLACE_US + 3)) == [(1, 5, 300)], "stopped where it was told to drive"
    assert places(one.sense(standing, 3 * PLACE_US)) == []


def test_what_a_robot_left_goes_back_after_the_word_for_where_it_is() -> None:
    one = sent_to_6()
    comes_to(one, 3, 1)
    one.advance(1)
    assert comes_to(one, 5, 2) == []
    effects = one.advance(2)
    assert given(effects) and places(effects) == [(1, 5, 0)]
    grants = [number for number, effect in enumerate(effects) if isinstance(effect, Send) and _goes(effect)]
    assert effects.index(Send(_place(effects))) < min(grants)


def test_who_said_that_it_reaches_into_a_slot_says_where_it_is_before_that_slot_goes_back() -> None:
    """Crash point 5797 of ``small``: stopped over a sill, a robot gave the gate back when it had driven off it."""
    one = sent_to_6()
    comes_to(one, 3, 1)
    one.advance(1)
    across = DriveState(ROBOT, one.sequence, 4 * PITCH_MM - 400, 0, DriveMode.STANDING, False, False)
    assert places(one.sense(across, 2)) == [(1, 5, -400)]
    assert Segment(1, 4) in one.occupied()
    one.advance(2)
    assert comes_to(one, 5, 3) == [], "the same place"
    effects = one.advance(3)
    assert 4 in given(effects) and places(effects) == [(1, 5, 0)]


def test_what_a_robot_left_and_granted_to_who_asked_is_followed_by_the_word_for_where_it_is() -> None:
    one = sent_to_6()
    one.left.fronts = frozenset()
    comes_to(one, 3, 1)
    comes_to(one, 5, 2)
    assert places(one.advance(2)) == [], "what it left waits for more"
    left = one.left.slots[-1]
    one.fleet.tokens.give(segment_token(left), RIDER + 1, 3)
    assert places(one.advance(3)) == [(1, 5, 0)] and places(one.advance(4)) == []


def test_a_lift_says_nothing_when_it_moves_off_nor_when_its_gate_comes_back() -> None:
    holon = lift_at(1)
    lift, pitch_mm = holon.behaviour, SITE.tracks[SHAFT].pitch_mm
    assert isinstance(lift, Lift)

    def sensed(position_mm: int, mode: DriveMode, now_us: int) -> list[int]:
        state = DriveState(LIFT, lift.link.sequence, position_mm, 0, mode, mode is DriveMode.STANDING)
        effects = lift.sense(state, now_us)
        return [e.message.index for e in effects if isinstance(e, Send) and isinstance(e.message, Progress)]

    holon.tokens.give(segment_token(gate(SHAFT)), RIDER, 100)
    assert sensed(0, DriveMode.STANDING, 100) == [1]
    holon.tokens.on_grant(TokenGrant(RIDER, TokenKind.SEGMENT, gate(SHAFT).number, 2, LIFT), 200)
    assert sensed(0, DriveMode.STANDING, 300) == sensed(1, DriveMode.MOVING, 400) == []
    assert sensed(pitch_mm, DriveMode.MOVING, 500) == [2]
    assert sensed(2 * pitch_mm, DriveMode.MOVING, 600) == []
    assert sensed(2 * pitch_mm, DriveMode.STANDING, 700) == [3]


def _goes(effect: Send) -> bool:
    return isinstance(effect.message, TokenGrant)


def _place(effects: list[Effect]) -> Progress:
    return next(e.message for e in effects if isinstance(e, Send) and isinstance(e.message, Progress))

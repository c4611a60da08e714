"""A carrier that was pushed by hand where it stood: it says so at once, and before a turn it goes back to the mark."""

import pytest

from onboard.contract.messages import TokenRequest
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from tests.kinds.test_turning import INSIDE, MOUTH, MOUTH_MM, PITCH_MM, Carriage, get, in_mouth, orders, places, state


def asked(effects: list[Effect]) -> list[int]:
    return [one.message.token for one in effects if isinstance(one, Send) and isinstance(one.message, TokenRequest)]


def ready_to_turn() -> Carriage:
    """It stands in the mouth, has told that, and has the rights to turn."""
    one = in_mouth()
    one.statement(0)
    get(one, INSIDE)
    return one


def test_pushed_into_another_slot_it_says_where_it_is_though_its_place_is_the_same() -> None:
    """Whoever had the right to that slot drove into it (drawn car parks, 3867)."""
    one = in_mouth()
    one.go(MOUTH)
    one.sense(state(MOUTH_MM), 1)
    one.statement(1)
    assert places(one.sense(state(MOUTH_MM - 20), 2)) == [], "it is in no other slot"
    assert places(one.sense(state(MOUTH_MM - 600), 3)) == [(1, 7, -600)]
    assert places(one.sense(state(MOUTH_MM - 600), 4)) == [], "it has said so"
    assert asked(one.advance(4)) == [Segment(1, 6).number]


@pytest.mark.parametrize(("by_mm", "neighbour"), [(-600, 6), (600, 8)])
def test_pushed_before_its_turn_it_goes_back_to_the_mark_and_turns_then(by_mm: int, neighbour: int) -> None:
    one = ready_to_turn()
    assert places(one.sense(state(MOUTH_MM + by_mm), 1)) == [(1, 7, by_mm)]
    assert set(one.occupied()) == {MOUTH, Segment(1, neighbour)}
    effects = one.advance(1)
    assert (asked(effects), orders(effects)) == ([Segment(1, neighbour).number], [])
    get(one, Segment(1, neighbour))
    assert orders(one.advance(2)) == [(MOUTH_MM, False)]
    one.sense(state(MOUTH_MM, sequence=one.sequence), 3)
    assert orders(one.advance(3)) == [(0, True)]


@pytest.mark.parametrize(("by_mm", "slot", "between"), [(-2 * PITCH_MM, 5, 6), (2 * PITCH_MM, 9, 8)])
def test_pushed_out_of_the_mouth_it_comes_back_to_it(by_mm: int, slot: int, between: int) -> None:
    """It went on to the end of the alley, and turned nowhere."""
    one = ready_to_turn()
    assert places(one.sense(state(MOUTH_MM + by_mm), 1)) == [(1, slot, 0)]
    assert set(asked(one.advance(1))) <= {Segment(1, slot).number, Segment(1, between).number}
    for index in (slot, between):
        get(one, Segment(1, index))
    assert orders(one.advance(2)) == [(MOUTH_MM, False)]
    one.sense(state(MOUTH_MM, sequence=one.sequence), 3)
    assert orders(one.advance(3)) == [(0, True)]

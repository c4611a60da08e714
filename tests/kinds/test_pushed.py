"""A carrier that was pushed by hand where it stood: it says so at once, and before a turn it goes back to the mark."""

import pytest

from onboard.contract.messages import Progress, TokenHeld, TokenRequest
from onboard.core.authority import segment_token
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.systems.car_park.travel import Carriage
from tests.kinds.test_turning import (
    INSIDE,
    MOUTH,
    MOUTH_MM,
    OTHER,
    PITCH_MM,
    carriage,
    get,
    in_mouth,
    orders,
    places,
    state,
)


def asked(effects: list[Effect]) -> list[int]:
    return [one.message.token for one in effects if isinstance(one, Send) and isinstance(one.message, TokenRequest)]


def ready_to_turn() -> Carriage:
    """It stands in the mouth, has told that, and has the rights to turn."""
    one = in_mouth()
    one.statement(0)
    get(one, INSIDE)
    return one


def test_pushed_into_another_slot_it_says_where_it_is_though_its_place_is_the_same() -> None:
    """Whoever has the right to that slot would drive into it (drawn car parks, 3867, with half of the mend)."""
    one = in_mouth()
    one.go(MOUTH)
    one.sense(state(MOUTH_MM), 1)
    one.statement(1)
    assert places(one.sense(state(MOUTH_MM - 20), 2)) == [], "it is in no other slot"
    effects = one.sense(state(MOUTH_MM - 600), 3)
    assert (places(effects), asked(effects)) == ([(1, 7, -600)], [Segment(1, 6).number])
    assert one.sense(state(MOUTH_MM - 600), 4) == [], "it has said so"


@pytest.mark.parametrize(("by_mm", "neighbour"), [(-600, 6), (600, 8)])
def test_pushed_before_its_turn_it_goes_back_to_the_mark_and_turns_then(by_mm: int, neighbour: int) -> None:
    one = ready_to_turn()
    effects = one.sense(state(MOUTH_MM + by_mm), 1)
    assert (places(effects), asked(effects)) == ([(1, 7, by_mm)], [Segment(1, neighbour).number])
    assert set(one.occupied()) == {MOUTH, Segment(1, neighbour)}
    assert orders(one.advance(1)) == []
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


def test_pushed_it_asks_for_the_slot_at_once_also_where_it_has_stopped_itself() -> None:
    """Its shuttle was sent out in the same moment, and failed: it stood in slots that it had just given back."""
    one = in_mouth()
    one.statement(0)
    one.stopped = True
    assert asked(one.sense(state(MOUTH_MM - 600), 1)) == [Segment(1, 6).number]
    effects = one.sense(state(MOUTH_MM - 2 * PITCH_MM), 2)
    assert (places(effects), asked(effects)) == ([(1, 5, 0)], [Segment(1, 5).number]), "also past a whole slot"


def pushed_to(other_at: int) -> Carriage:
    """On its way on from p(1,7) to p(1,9) it was pushed back by 100 mm, into p(1,6), which another has."""
    one = carriage()
    one.sense(state(MOUTH_MM), 0)
    for index in (7, 8, 9):
        get(one, Segment(1, index))
    one.go(Segment(1, 9))
    one.fleet.mirror.on_progress(Progress(OTHER, 1, 0, 1, other_at, 0, 0))
    key = segment_token(Segment(1, 6))
    one.fleet.tokens.on_held(TokenHeld(OTHER, key.kind, key.number, 1))
    one.sense(state(MOUTH_MM - 100), 1)
    return one


def test_pushed_against_another_it_drives_away_from_it() -> None:
    """Neither could have the other's right, and both stood until somebody pushed again (drawn car parks, 3975)."""
    assert orders(pushed_to(other_at=6).advance(1)) == [(MOUTH_MM + 2 * PITCH_MM, False)]


def test_where_the_holder_does_not_stand_in_the_slot_it_waits_for_the_right() -> None:
    assert orders(pushed_to(other_at=4).advance(1)) == []


def test_pushed_against_another_it_does_not_drive_towards_it() -> None:
    one = pushed_to(other_at=6)
    one.go(Segment(1, 5))
    get(one, Segment(1, 5))
    assert orders(one.advance(1)) == []

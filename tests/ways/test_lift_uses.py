import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways.lift_uses import (
    GATE_US,
    Gap,
    are_compatible,
    floor_intervals,
    lift_gaps,
    ride_us,
    run_up_us,
    standing_after,
)
from onboard.ways.lifts import platform
from onboard.ways.occupancy import final_position, itinerary_windows, lift_uses
from onboard.ways.reservations import FOREVER, Interval, Reservations, SlotWindow, Use
from onboard.ways.site import Axis
from tests.ways.buildings import LEFT, RIGHT, building

#: As in the tests of occupancy: 10 mm a segment and a floor; one step of either takes 20 ms, each more 10 ms.
QUICK = Axis(1_000, 100_000)
MS = 1_000


def quick(floors: int = 3, clearance_mm: int = 0) -> CarPark:
    return building(floors, 6, QUICK, pitch_mm=10, floor_mm=10, carrier_length_mm=10, clearance_mm=clearance_mm)


def plan(*legs: tuple[LegAction, int, int, int, int]) -> Itinerary:
    told = tuple(Leg(action, track, here, there, Side.NEAR, end) for action, track, here, there, end in legs)
    return Itinerary(11, 1, Grade.FIRM, Stamp(100, 1, 1), told)


THROUGH = plan(
    (LegAction.STAND, 1, 2, 2, 110),
    (LegAction.TRAVEL, 1, 2, 0, 140),
    (LegAction.STAND, 1, 0, 0, 150),
    (LegAction.RIDE, LEFT, 1, 3, 190),
    (LegAction.TRAVEL, 3, 0, 7, 270),
    (LegAction.RIDE, RIGHT, 3, 2, 310),
    (LegAction.TRAVEL, 2, 7, 5, 340),
)


def spans_ms(windows: list[SlotWindow], segment: Segment) -> list[tuple[float, float]]:
    return [(w.from_us / MS, w.to_us / MS if w.to_us < FOREVER else -1) for w in windows if w.segment == segment]


# --- what an itinerary occupies ---------------------------------------------------------------------------------------


def test_a_platform_is_occupied_from_crossing_its_sill_to_having_left() -> None:
    windows = itinerary_windows(quick(), THROUGH, 0)
    assert spans_ms(windows, platform(LEFT)) == [(125, 140), (140, 150), (150, 190), (190, 205)]
    assert spans_ms(windows, platform(RIGHT)) == [(255, 270), (270, 310), (310, 325)]
    assert spans_ms(windows, Segment(1, 1)) == [(110, 140)]  # until the run ends: its rear leaves just then
    assert spans_ms(windows, Segment(3, 1)) == [(190, 215)]
    assert spans_ms(windows, Segment(2, 5)) == [(325, 340), (340, -1)]
    assert all(0 < w.segment.index <= 6 or w.segment in {platform(LEFT), platform(RIGHT)} for w in windows)


def test_uses_go_from_the_first_window_on_the_platform_to_the_last() -> None:
    assert lift_uses(quick(), THROUGH, 0) == [
        Use(LEFT, 1, 3, 125 * MS, 205 * MS, 11),
        Use(RIGHT, 3, 2, 255 * MS, 325 * MS, 11),
    ]
    assert final_position(quick(), THROUGH) == Segment(2, 5)


def test_one_who_ends_aboard_uses_the_lift_for_ever() -> None:
    site = quick()
    begun = Itinerary(11, 1, Grade.FIRM, Stamp(100, 1, 1), THROUGH.legs[:4])
    assert lift_uses(site, begun, 0) == [Use(LEFT, 1, 3, 125 * MS, FOREVER, 11)]
    assert final_position(site, begun) == Segment(3, 0)
    rest = Itinerary(11, 2, Grade.FIRM, Stamp(150, 1, 1), THROUGH.legs[3:5])
    assert lift_uses(site, rest, 0)[0] == Use(LEFT, 1, 3, 150 * MS, 205 * MS, 11)


def test_who_leaves_and_comes_back_uses_the_lift_twice() -> None:
    back = plan(
        (LegAction.STAND, 1, 0, 0, 100),
        (LegAction.RIDE, LEFT, 1, 2, 120),
        (LegAction.TRAVEL, 2, 0, 1, 140),
        (LegAction.TRAVEL, 2, 1, 0, 160),
    )
    assert [(use.board_index, use.leave_index) for use in lift_uses(quick(), back, 0)] == [(1, 2), (2, 2)]


def test_clearance_does_not_reach_through_the_door_of_a_shaft() -> None:
    site = quick(clearance_mm=10)  # one place on either side
    near = plan((LegAction.STAND, 1, 1, 1, 110), (LegAction.TRAVEL, 1, 1, 3, 140))
    assert lift_uses(site, near, 0) == []
    aboard = plan((LegAction.STAND, 1, 0, 0, 110), (LegAction.RIDE, LEFT, 1, 2, 130))
    windows = itinerary_windows(site, aboard, 0)
    # On the platform it reaches out into the alley while it stands there, and not while it rides.
    assert spans_ms(windows, Segment(1, 1)) == [(100, 110)]
    assert spans_ms(windows, Segment(2, 1)) == [(130, -1)]


@pytest.mark.parametrize("index", [0, 4, 9, 255])
def test_rides_of_nonsense_raise_nothing(index: int) -> None:
    nonsense = plan((LegAction.RIDE, LEFT, index, index, 120), (LegAction.TRAVEL, 2, 0, index, 150))
    for use in lift_uses(quick(), nonsense, 0):
        assert 1 <= use.board_index <= 3 and 1 <= use.leave_index <= 3


# --- gaps -------------------------------------------------------------------------------------------------------------


def use(board: int, leave: int, from_ms: int, to_ms: int, owner: int = 12) -> Use:
    return Use(LEFT, board, leave, from_ms * MS, to_ms * MS, owner)


def test_gaps_begin_where_the_one_before_left_and_end_where_the_next_boards() -> None:
    uses = [use(1, 3, 0, 90), use(2, 1, 200, 300), use(1, 3, 300, 400)]
    assert lift_gaps(uses, 100 * MS, 2) == [
        Gap(100 * MS, 200 * MS, 2, 2),
        Gap(400 * MS, FOREVER, 3, None),
    ]
    assert lift_gaps(uses, 50 * MS, 2)[0] == Gap(90 * MS, 200 * MS, 3, 2)  # under way: it leaves at floor 3
    assert lift_gaps([*uses, use(1, 1, 500, 600)._replace(to_us=FOREVER)], 0, 1)[-1].to_us == 500 * MS


def test_a_floor_is_safe_from_when_the_lift_can_be_there_until_it_has_to_go() -> None:
    site = quick()
    gaps = lift_gaps([use(2, 3, 200, 300)], 100 * MS, 1)
    at = {k: [(i.from_us // MS, i.to_us // MS) for i in floor_intervals(site, LEFT, gaps, k)] for k in (1, 2, 3)}
    assert [at[k][0] for k in (1, 2, 3)] == [(100, 180), (120, 200), (130, 180)]
    assert [at[k][1][0] for k in (1, 2, 3)] == [330, 320, 300]
    short = lift_gaps([use(2, 3, 125, 300)], 100 * MS, 1)
    assert floor_intervals(site, LEFT, short, 3)[0].from_us == 300 * MS  # no time to go up and down again


def test_a_ride_lasts_the_platforms_run_and_the_gates_tokens() -> None:
    assert run_up_us(quick(), LEFT, 2, 2) == 0
    assert ride_us(quick(), LEFT, 3, 1) == 30 * MS + GATE_US


def test_two_uses_need_the_empty_run_between_them() -> None:
    site = quick()
    assert are_compatible(site, use(1, 3, 0, 100), use(1, 2, 130, 200, 13))
    assert not are_compatible(site, use(1, 3, 0, 100), use(1, 2, 129, 200, 13))
    assert not are_compatible(site, use(1, 2, 129, 200, 13), use(1, 3, 0, 100))
    assert are_compatible(site, use(1, 3, 0, 100), use(3, 2, 100, 200, 13))
    assert are_compatible(site, use(1, 3, 0, 100), use(1, 2, 0, 100)._replace(lift_track=RIGHT))


def test_where_lifts_stand_when_a_plan_begins_later() -> None:
    uses = [use(3, 2, 300, 400), use(1, 3, 100, 200), use(2, 1, 0, 40)]
    assert standing_after(uses, {RIGHT: 2}, 50 * MS, 250 * MS) == {LEFT: 3, RIGHT: 2}
    assert standing_after(uses, {LEFT: 1}, 50 * MS, 150 * MS) == {LEFT: 1}
    assert standing_after(uses, {}, 50 * MS, 400 * MS) == {LEFT: 2}


# --- the book of reservations -----------------------------------------------------------------------------------------


def test_uses_are_kept_sorted_and_released_with_the_windows() -> None:
    book = Reservations()
    mine, theirs = use(1, 2, 50, 80, 11), use(1, 3, 0, 40)
    book.reserve(11, [SlotWindow(platform(LEFT), 50 * MS, 80 * MS)], [mine])
    book.reserve(12, [], [theirs])
    assert book.uses(LEFT, 0) == [theirs, mine]
    assert book.uses(LEFT, 11) == [theirs]
    assert book.uses(RIGHT, 0) == []
    book.release(11)
    assert book.uses(LEFT, 0) == [theirs]
    assert book.safe_intervals(platform(LEFT), 0, 0) == [Interval(0, FOREVER)]


@pytest.mark.parametrize("wrong", [use(1, 2, 50, 50, 11), use(1, 2, 50, 60, 12)])
def test_a_use_without_length_or_of_another_is_no_use(wrong: Use) -> None:
    with pytest.raises(ValueError, match="no length"):
        Reservations().reserve(11, [], [wrong])

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.occupancy import itinerary_windows, leg_sweeps, standing_segments, travel_windows
from onboard.ways.reservations import FOREVER, SlotWindow
from onboard.ways.site import Axis
from tests.ways.lines import ALLEY, SPUR, line_site

#: 10 mm a segment, 1 m/s, top speed after 5 mm and 10 ms: half-millimetre arithmetic by hand, all times in 5 ms.
QUICK = Axis(1_000, 100_000)


def quick_site(length: int = 6, carrier_length_mm: int = 10, clearance_mm: int = 0) -> CarPark:
    return line_site(length, 10, QUICK, carrier_length_mm, clearance_mm, spur_at=2)


def itinerary(*legs: Leg, award_ms: int = 100) -> Itinerary:
    return Itinerary(11, 1, Grade.FIRM, Stamp(award_ms, 1, 1), legs)


def leg(action: LegAction, track: int, from_index: int, to_index: int, end_ms: int) -> Leg:
    return Leg(action, track, from_index, to_index, Side.NEAR, end_ms)


def spans_ms(windows: list[SlotWindow]) -> list[tuple[str, float, float]]:
    return [(str(w.segment), w.from_us / 1000, w.to_us / 1000 if w.to_us < FOREVER else -1) for w in windows]


def test_a_body_as_long_as_a_segment_holds_two_of_them_while_it_crosses() -> None:
    assert [(s.offset, s.enter_us, s.leave_us) for s in leg_sweeps(quick_site(), ALLEY, 3)] == [
        (0, 0, 15_000),
        (1, 0, 25_000),  # the front stands at the border already
        (2, 15_000, 40_000),
        (3, 25_000, 40_000),
    ]


def test_half_millimetres_are_rounded_to_the_longer_window() -> None:
    # A body of 10 mm on segments of 11 mm: its front is half a millimetre from the border, 0.5 mm take 0.5 ms.
    site = line_site(6, 11, QUICK, 8, 1)
    assert [(s.offset, s.enter_us, s.leave_us) for s in leg_sweeps(site, ALLEY, 3)] == [
        (0, 0, 16_000),  # 10.5 mm
        (1, 0, 27_000),  # 0.5 mm and 21.5 mm
        (2, 16_000, 43_000),  # 11.5 mm and 32.5 mm, the end
        (3, 27_000, 43_000),
    ]
    assert standing_segments(line_site(6, 11, QUICK, 11), Segment(ALLEY, 3)) == [Segment(ALLEY, 3)]


@pytest.mark.parametrize(
    ("carrier_length_mm", "clearance_mm", "held"),
    [(10, 0, [3]), (8, 1, [3]), (9, 0, [3]), (11, 0, [2, 3, 4]), (10, 10, [2, 3, 4]), (10, 11, [1, 2, 3, 4, 5])],
)
def test_clearance_reaches_into_the_neighbours(carrier_length_mm: int, clearance_mm: int, held: list[int]) -> None:
    site = quick_site(length=9, carrier_length_mm=carrier_length_mm, clearance_mm=clearance_mm)
    assert [segment.index for segment in standing_segments(site, Segment(ALLEY, 3))] == held


def test_a_track_has_nothing_beyond_its_ends() -> None:
    site = quick_site(length=3, clearance_mm=10)
    assert [s.index for s in standing_segments(site, Segment(ALLEY, 1))] == [1, 2]
    touched = {w.segment.index for w in travel_windows(site, Segment(ALLEY, 1), 3, 0, 30_000)}
    assert touched == {1, 2, 3}


def test_an_itinerary_runs_works_and_stands_for_ever() -> None:
    plan = itinerary(
        leg(LegAction.STAND, ALLEY, 4, 4, 110),
        leg(LegAction.TRAVEL, ALLEY, 4, 3, 130),
        leg(LegAction.WORK, ALLEY, 3, 3, 150),
    )
    assert spans_ms(itinerary_windows(quick_site(), plan, 0)) == [
        ("p(1,4)", 100, 110),
        ("p(1,4)", 110, 130),
        ("p(1,3)", 110, 130),
        ("p(1,3)", 130, 150),
        ("p(1,3)", 150, -1),
    ]


def test_a_leg_longer_than_its_run_counts_from_the_earliest_entering_to_the_latest_leaving() -> None:
    plan = itinerary(leg(LegAction.TRAVEL, ALLEY, 3, 5, 180))  # 30 ms of travel somewhere in 80
    assert spans_ms(itinerary_windows(quick_site(), plan, 0))[:3] == [
        ("p(1,3)", 100, 165),
        ("p(1,4)", 100, 180),
        ("p(1,5)", 115, 180),
    ]


def test_a_leg_shorter_than_its_run_began_before() -> None:
    plan = itinerary(leg(LegAction.TRAVEL, ALLEY, 3, 5, 120))  # 30 ms of travel that end 20 ms from now
    assert spans_ms(itinerary_windows(quick_site(), plan, 0))[:3] == [
        ("p(1,3)", 90, 115),
        ("p(1,4)", 90, 130),
        ("p(1,5)", 105, 130),
    ]


def test_a_hop_into_a_spur_holds_its_mouth_until_it_ends() -> None:
    plan = itinerary(leg(LegAction.STAND, ALLEY, 2, 2, 100), leg(LegAction.TRAVEL, SPUR, 1, 1, 120))
    assert spans_ms(itinerary_windows(quick_site(), plan, 0)) == [
        ("p(1,2)", 100, 120),
        ("p(192,1)", 100, 120),
        ("p(192,1)", 120, -1),
    ]


@pytest.mark.parametrize(("track", "index"), [(SPUR, 1), (ALLEY, 2)], ids=["into the spur", "out of it"])
def test_a_plan_told_anew_in_the_middle_of_a_hop_still_holds_both_its_ends(track: int, index: int) -> None:
    plan = itinerary(leg(LegAction.TRAVEL, track, index, index, 120))
    held = [span for span in spans_ms(itinerary_windows(quick_site(), plan, 0)) if span[2] != -1]
    assert sorted(held) == [("p(1,2)", 100, 120), ("p(192,1)", 100, 120)]


def test_a_released_itinerary_holds_nothing() -> None:
    assert itinerary_windows(quick_site(), Itinerary(11, 1, Grade.RELEASED, Stamp(0, 0, 0), ()), 0) == []


LEGS = st.builds(
    Leg,
    st.sampled_from(LegAction),
    st.sampled_from([0, ALLEY, 7, SPUR, 255]),
    st.integers(0, 255),
    st.integers(0, 255),
    st.sampled_from(Side),
    st.integers(0, 2**32 - 1),
)


@given(st.lists(LEGS, max_size=6), st.integers(0, 2**32 - 1))
def test_an_itinerary_of_nonsense_gives_windows_on_the_site_and_never_raises(legs: list[Leg], award_ms: int) -> None:
    site = quick_site()
    for window in itinerary_windows(site, itinerary(*legs, award_ms=award_ms), 0):
        assert 1 <= window.segment.index <= site.tracks[window.segment.track].length
        assert window.from_us < window.to_us


@given(
    st.builds(Axis, st.integers(100, 3_000), st.integers(100, 3_000)),
    st.integers(1_001, 3_000),
    st.integers(500, 4_000),
    st.integers(0, 500),
    st.integers(1, 8),
    st.integers(1, 8),
    st.floats(0, 1),
)
def test_wherever_the_body_is_during_a_run_its_segments_are_held(
    axis: Axis, pitch_mm: int, length_mm: int, clearance_mm: int, origin: int, goal: int, part: float
) -> None:
    site = line_site(8, pitch_mm, axis, length_mm, clearance_mm)
    if origin == goal:
        goal = origin % 8 + 1
    distance_mm = abs(goal - origin) * pitch_mm
    top = min(axis.speed_mm_s, (distance_mm * axis.acceleration_mm_s2) ** 0.5)
    ramp_s = top / axis.acceleration_mm_s2
    duration_s = distance_mm / top + ramp_s
    at_s = part * duration_s
    if at_s <= ramp_s:
        travelled = axis.acceleration_mm_s2 * at_s**2 / 2
    elif at_s >= duration_s - ramp_s:
        travelled = distance_mm - axis.acceleration_mm_s2 * (duration_s - at_s) ** 2 / 2
    else:
        travelled = top * (at_s - ramp_s / 2)
    centre = (origin - 1) * pitch_mm + (travelled if goal > origin else -travelled)
    half = length_mm / 2 + clearance_mm
    overlapped = {
        index
        for index in range(1, 9)
        if (index - 1.5) * pitch_mm < centre + half - 0.01 and (index - 0.5) * pitch_mm > centre - half + 0.01
    }
    windows = travel_windows(site, Segment(ALLEY, origin), goal, 0, run_duration_us(distance_mm, axis))
    held = {w.segment.index for w in windows if w.from_us - 1 <= at_s * 1e6 <= w.to_us + 1}
    assert overlapped <= held


def test_whoever_is_turned_in_the_mouth_of_a_spur_is_in_both() -> None:
    assert standing_segments(quick_site(), Segment(SPUR, 0)) == [Segment(ALLEY, 2), Segment(SPUR, 1)]

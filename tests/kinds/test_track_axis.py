"""A spur as a carrier's drive sees it: the mouth is index 0, and whoever turns there needs both slots."""

from onboard.core.site import Segment
from onboard.systems.car_park.axis import TrackAxis
from tests.sites import one_floor

MOUTH, INSIDE = Segment(1, 7), Segment(192, 1)
SPUR = TrackAxis(one_floor(extra='[[spurs]]\nat = "p(1,7)"\n'), 192)
HALF_MM = 1_150


def test_a_spur_has_its_mouth_one_pitch_before_its_segment() -> None:
    assert (SPUR.lowest, SPUR.highest, SPUR.mouths) == (0, 1, {0: MOUTH})
    assert (SPUR.position_mm(0), SPUR.position_mm(1)) == (-2_400, 0)
    assert [SPUR.index_at(mm) for mm in (-2_400, -1_300, -1_100, 0)] == [0, 0, 1, 1]


def test_whoever_turns_in_the_mouth_needs_the_spur_too() -> None:
    assert SPUR.rights([0, 1]) == [[MOUTH, INSIDE], [INSIDE]]
    assert SPUR.rights([1, 0]) == [[INSIDE], [MOUTH, INSIDE]]


def test_a_body_is_in_both_slots_until_it_is_wholly_inside() -> None:
    for centre_mm, slots in (
        (-2_400, {MOUTH, INSIDE}),
        (-1_200, {MOUTH, INSIDE}),
        (-60, {MOUTH, INSIDE}),
        (0, {INSIDE}),
    ):
        assert set(SPUR.overlapped(centre_mm - HALF_MM, centre_mm + HALF_MM)) == slots, centre_mm


def test_an_alley_does_not_care_for_the_spurs_beside_it() -> None:
    alley = TrackAxis(SPUR.site, 1)
    assert (alley.lowest, alley.highest, alley.mouths) == (1, 12, {})
    assert alley.rights([6, 7]) == [[Segment(1, 6)], [MOUTH]]

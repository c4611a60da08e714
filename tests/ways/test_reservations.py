from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.core.site import Segment
from onboard.ways.reservations import FOREVER, Interval, Reservations, SlotWindow, Use

HERE = Segment(1, 4)
THERE = Segment(1, 5)
HORIZON = 40

WINDOWS = st.builds(
    lambda segment, start, length: SlotWindow(segment, start, FOREVER if length == 0 else start + length),
    st.sampled_from([HERE, THERE]),
    st.integers(0, HORIZON - 1),
    st.integers(0, 12),
)
#: What a bus brings: a node's new plan takes the place of its old one, or a node's plan is voided.
PLANS = st.lists(st.tuples(st.integers(1, 3), st.lists(WINDOWS, max_size=4)), max_size=6)


def filled(plans: list[tuple[int, list[SlotWindow]]]) -> tuple[Reservations, list[tuple[int, SlotWindow]]]:
    """The reservations under test, and beside them the naive list."""
    reservations = Reservations()
    naive: list[tuple[int, SlotWindow]] = []
    for owner, windows in plans:
        reservations.release(owner)
        reservations.reserve(owner, windows)
        naive = [entry for entry in naive if entry[0] != owner] + [(owner, window) for window in windows]
    return reservations, naive


@given(PLANS, st.integers(0, 4), st.integers(0, HORIZON))
def test_safe_intervals_are_the_instants_that_no_other_node_holds(
    plans: list[tuple[int, list[SlotWindow]]], owner: int, from_us: int
) -> None:
    reservations, naive = filled(plans)
    for segment in (HERE, THERE):
        gaps = reservations.safe_intervals(segment, owner, from_us)
        others = [w for holder, w in naive if holder != owner and w.segment == segment]
        for instant in [*range(from_us, 2 * HORIZON), FOREVER - 1]:
            held = any(w.from_us <= instant < w.to_us for w in others)
            assert held != any(gap.from_us <= instant < gap.to_us for gap in gaps)
        assert all(gap.from_us >= from_us for gap in gaps)
        # In order and as long as can be: two gaps never touch.
        assert all(one.from_us < one.to_us < two.from_us for one, two in pairwise(gaps))


def test_who_follows_at_once_or_is_followed_is_apart_from_me_and_who_is_in_my_way_is_not() -> None:
    """Told in whole milliseconds, they meet by their rounding (drawn car parks, 4693: a robot found no way)."""
    reservations = Reservations()
    reservations.reserve(1, [SlotWindow(HERE, 100, 200)], [Use(128, 1, 2, 100, 200, 1)])
    assert reservations.apart(1, 10) is reservations
    for node, from_us, to_us in ((2, 50, 105), (3, 195, 250), (4, 180, 300), (5, 196, 199)):
        reservations.reserve(node, [SlotWindow(HERE, from_us, to_us)], [Use(128, 1, 2, from_us, to_us, node)])
    left = [(50, 100, 2), (100, 200, 1), (180, 300, 4), (200, 250, 3)]
    apart = reservations.apart(1, 10)
    assert apart.on(HERE) == left
    assert [(use.from_us, use.to_us, use.owner) for use in apart.uses(128, excluding=0)] == left
    assert reservations.apart(6, 10) is reservations
    assert len(reservations.on(HERE)) == len(left) + 1, "a copy"


@given(PLANS, st.integers(1, 3), st.integers(1, 3))
def test_of_no_window_of_others_more_is_left_out_at_either_end_than_the_tolerance(
    plans: list[tuple[int, list[SlotWindow]]], owner: int, tolerance_us: int
) -> None:
    """A stand of a millisecond amid another's time took all that came after it from that (a robot drove at another)."""
    reservations, naive = filled(plans)
    apart = reservations.apart(owner, tolerance_us)
    for segment in (HERE, THERE):
        held = {(at, node) for start, end, node in apart.on(segment) for at in range(start, min(end, 2 * HORIZON))}
        for node, window in naive:
            inner = range(window.from_us + tolerance_us, min(window.to_us, 2 * HORIZON) - tolerance_us)
            kept = window.segment != segment or all((at, node) in held for at in inner)
            assert kept


@given(PLANS, st.integers(1, 3), st.lists(WINDOWS, max_size=4))
def test_conflicts_are_all_overlaps_with_other_nodes(
    plans: list[tuple[int, list[SlotWindow]]], owner: int, windows: list[SlotWindow]
) -> None:
    reservations, naive = filled(plans)
    expected = [
        (window, holder)
        for window in windows
        for holder, other in naive
        if holder != owner and other.segment == window.segment
        if other.from_us < window.to_us and window.from_us < other.to_us
    ]
    assert sorted(reservations.conflicts(owner, windows)) == sorted(expected)


@given(PLANS, st.integers(1, 3), st.integers(0, HORIZON))
def test_passing_order_is_read_from_the_first_window_that_is_not_over(
    plans: list[tuple[int, list[SlotWindow]]], owner: int, now_us: int
) -> None:
    reservations, naive = filled(plans)
    open_here = [(holder, w.from_us) for holder, w in naive if w.segment == HERE and w.to_us > now_us]
    others = [start for holder, start in open_here if holder != owner]
    assert [begin for begin, end, _ in reservations.on(HERE) if end > now_us] == sorted(start for _, start in open_here)
    assert reservations.earliest_other_start(owner, HERE, now_us) == min(others, default=None)
    assert reservations.is_free(HERE, now_us, excluding=owner) == (not others)


@given(PLANS, st.lists(WINDOWS, max_size=4))
def test_apart_is_reserved_all_that_meets_nobody_else_or_nothing(
    plans: list[tuple[int, list[SlotWindow]]], windows: list[SlotWindow]
) -> None:
    (asked, before), new = [filled(plans)[0] for _ in range(2)], 4
    is_apart = not before.conflicts(new, windows)
    assert asked.reserve_apart(new, windows) is is_apart
    if is_apart:
        before.reserve(new, windows)
    assert [asked.on(segment) or () for segment in (HERE, THERE)] == [before.on(one) for one in (HERE, THERE)]
    asked.release(new)
    assert not any(owner == new for segment in (HERE, THERE) for _, _, owner in asked.on(segment))


def test_a_released_node_leaves_the_windows_of_others() -> None:
    reservations, _ = filled([(1, [SlotWindow(HERE, 10, 20)]), (2, [SlotWindow(HERE, 15, 30)]), (1, [])])
    assert reservations.safe_intervals(HERE, 9, 0) == [Interval(0, 15), Interval(30, FOREVER)]


def test_who_has_given_way_in_a_copy_leaves_the_windows_of_others_when_released() -> None:
    reservations = Reservations()
    reservations.reserve(1, [SlotWindow(HERE, 20, FOREVER)])
    reservations.reserve(2, [SlotWindow(HERE, 0, 10)])
    copy = reservations.with_way_given(15)
    copy.release(1)
    assert list(copy.on(HERE)) == [(0, 10, 2)]


@pytest.mark.parametrize("to_us", [10, 9])
def test_a_window_without_length_is_a_broken_invariant(to_us: int) -> None:
    with pytest.raises(ValueError, match=r"node 7 has no length"):
        Reservations().reserve(7, [SlotWindow(HERE, 10, to_us)])

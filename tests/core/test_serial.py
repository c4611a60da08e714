"""Times and stamps that wrap are compared by the shorter way round (RFC 1982), never by ``<``."""

import pytest

from onboard.contract.messages import Reference, Stamp
from onboard.core.serial import BUS_MS_MODULUS, away, from_bus_ms, ms_after, ranks_before, to_bus_ms
from onboard.systems.cell.contracts import NO_LIMIT, Urgency

LAST_MS = BUS_MS_MODULUS - 1
HALF_MS = BUS_MS_MODULUS >> 1


@pytest.mark.parametrize(
    ("one", "other", "after"),
    [(5, 3, 2), (3, 5, -2), (0, LAST_MS, 1), (LAST_MS, 0, -1), (7, 7, 0), (HALF_MS, 0, -HALF_MS)],
)
def test_a_time_is_after_another_by_the_shorter_way_round(one: int, other: int, after: int) -> None:
    assert ms_after(one, other) == after
    assert away(one, other, BUS_MS_MODULUS) == after


@pytest.mark.parametrize("near_us", [0, LAST_MS * 1000, 10**15, -5_000_000])
def test_a_time_on_the_wire_is_the_nearest_that_reads_so(near_us: int) -> None:
    for by_us in (-(10**9), -1000, 0, 1000, 10**9):
        told_us = near_us + by_us
        assert from_bus_ms(to_bus_ms(told_us), near_us) == -(-told_us // 1000) * 1000


def test_a_stamp_of_before_the_wrap_ranks_before_one_behind_it() -> None:
    early, late = Stamp(LAST_MS - 50, 9, 9), Stamp(20, 1, 1)
    assert ranks_before(early, late)
    assert not ranks_before(late, early)


def test_of_two_stamps_that_differ_exactly_one_ranks_before_the_other() -> None:
    times = (0, 1, HALF_MS - 1, HALF_MS, HALF_MS + 1, LAST_MS)
    stamps = [Stamp(ms, initiator, call) for ms in times for initiator in (1, 2) for call in (3, 200)]
    for one in stamps:
        for other in stamps:
            assert ranks_before(one, other) + ranks_before(other, one) == (one != other)


def test_equal_awards_rank_by_initiator_then_call() -> None:
    assert ranks_before(Stamp(5, 1, 9), Stamp(5, 2, 1))
    assert ranks_before(Stamp(5, 1, 1), Stamp(5, 1, 9))


def test_goals_of_the_cell_are_as_urgent_as_their_limits_whatever_wraps() -> None:
    soon, later, never = (Urgency(ms, Reference(1, 1)) for ms in (LAST_MS - 5, 300, NO_LIMIT))
    assert sorted([never, later, soon], key=lambda one: one) == [soon, later, never]
    assert Urgency(300, Reference(1, 1)) < Urgency(300, Reference(1, 2))

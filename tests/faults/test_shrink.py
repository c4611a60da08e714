"""Delta debugging keeps the fewest faults that still fail, in their order."""

from collections.abc import Sequence

import pytest

from bus_sim.campaign.shrink import shrink


@pytest.mark.parametrize("needed", [set(), {3}, {0, 7}, {1, 4, 6}, set(range(8))])
def test_what_is_left_is_what_is_needed(needed: set[int]) -> None:
    assert shrink(range(8), lambda rest: needed <= set(rest), limit=200) == sorted(needed)


def test_it_gives_up_in_time_with_something_that_still_fails() -> None:
    asked: list[Sequence[int]] = []

    def fails(rest: Sequence[int]) -> bool:
        asked.append(rest)
        return {2, 9} <= set(rest)

    left = shrink(range(32), fails, limit=3)
    assert len(asked) == 3
    assert {2, 9} <= set(left)

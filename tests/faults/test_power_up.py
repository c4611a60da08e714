"""All machines of a site start together: nobody says again what all have heard (issue 16, item 2)."""

import pytest

from bus_sim.campaign.power_up import large_with, power_up


def test_twenty_six_machines_start_on_a_bus_that_is_hardly_used() -> None:
    found = power_up(large_with(26))
    assert found.worst_second <= 0.10
    assert len(found.parts_s) == 26 and found.longest_s <= 5.0
    assert found.mirrors == 1
    assert found.frames["SyncRequest"] == found.frames["SyncDone"] == 26


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_where_each_misses_every_tenth_frame(seed: int) -> None:
    found = power_up(large_with(26), 0.1, seed)
    assert found.worst_second <= 0.15
    assert len(found.parts_s) == 26 and found.longest_s <= 10.0

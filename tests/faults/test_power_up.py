"""All machines of a site start together: nobody says again what all have heard (issue 16, item 2)."""

from functools import partial

import pytest

from bus_sim.campaign.power_up import large_with, power_up
from bus_sim.systems.car_park.standing_cars import stand_drawn


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


#: In a tenth of a second a bus of 125 kbit/s has room for 87 words; some six are said for each of these.
CARS = 300


def test_computers_that_boot_one_by_one_wake_a_full_park_on_a_slow_bus() -> None:
    """Each asks all, and is asked by all who came before it; what all vouch for is told to all who wait for it."""
    found = power_up(large_with(18, 125_000), within_us=5_000_000, before=partial(stand_drawn, CARS))
    print(found)
    assert len(found.parts_s) == 18 and found.longest_s <= 10.0
    assert found.mirrors == 1

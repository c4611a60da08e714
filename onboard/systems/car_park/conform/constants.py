"""For which constants of a site the play was written: of others it cannot be sure that what fails is the node's."""

from collections.abc import Callable
from typing import NamedTuple

from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark, car_park


class PlayedWith(NamedTuple):
    """A key of the site file, and from which value to which the product's robot keeps every check (measured).

    On the four sites of ``tests/conform``, one key at a time; ``tests/conform/test_constants.py`` plays the ends.
    """

    key: str
    low: int
    high: int
    of: Callable[[CarPark], int]


PLAYED_WITH = (
    PlayedWith("timing.heartbeat_ms", 2_000, 2_000, lambda site: site.timing.heartbeat_us // 1000),
    PlayedWith("timing.bus_time_ms", 2_000, 5_000, lambda site: site.timing.bus_time_us // 1000),
    PlayedWith("timing.call_window_ms", 600, 1_000, lambda site: site.timing.call_window_us // 1000),
    PlayedWith("timing.bid_delay_ms", 100, 300, lambda site: site.timing.bid_delay_us // 1000),
    PlayedWith("timing.bid_half_ms", 10_000, 60_000, lambda site: site.timing.bid_half_us // 1000),
    PlayedWith("timing.deadline_guard_ms", 20, 20, lambda site: site.timing.deadline_guard_us // 1000),
    PlayedWith("timing.award_repeat_ms", 50, 100, lambda site: site.timing.award_repeat_us // 1000),
    PlayedWith("timing.token_repeat_ms", 200, 200, lambda site: site.timing.token_repeat_us // 1000),
    PlayedWith("timing.door_ms", 3_000, 3_000, lambda site: site.timing.door_us // 1000),
    PlayedWith("timing.grip_ms", 2_000, 9_000, lambda site: site.timing.grip_us // 1000),
    PlayedWith("carrier.speed_mm_s", 1_500, 1_500, lambda site: site.carrier.speed_mm_s),
    PlayedWith("carrier.acceleration_mm_s2", 500, 500, lambda site: site.carrier.acceleration_mm_s2),
    PlayedWith("carrier.turn_ms", 3_000, 3_000, lambda site: site.carrier_turn_us // 1000),
    PlayedWith("carrier.clearance_mm", 50, 50, lambda site: site.carrier_clearance_mm),
    PlayedWith("shuttle.speed_mm_s", 750, 750, lambda site: site.shuttle.speed_mm_s),
)


def unlike(site: Site) -> list[str]:
    """The constants of a site for which the play was not written, each with those for which it was."""
    park = car_park(site)
    return [
        f"{one.key} = {one.of(park)} ({one.low if one.low == one.high else f'{one.low} to {one.high}'})"
        for one in PLAYED_WITH
        if not one.low <= one.of(park) <= one.high
    ]

"""Constants of a site drawn by chance: how fast its machines are, how often they speak, how long they wait."""

import random
from collections.abc import Sequence

from bench._drawn_tables import Tables

#: Of each key the values that are drawn, from far below its default to far above; docs/site-file.md has the defaults.
_TIMING: dict[str, Sequence[int]] = {
    "heartbeat_ms": (500, 1_000, 1_500, 3_000, 4_000, 5_000, 8_000, 10_000),
    "bus_time_ms": (500, 1_000, 2_500, 8_000, 12_000, 20_000),
    "call_window_ms": (400, 600, 800, 1_500, 2_500, 4_000, 8_000),
    "bid_delay_ms": (30, 60, 120, 500, 900, 1_500),
    "bid_half_ms": (500, 2_000, 30_000, 120_000),
    "deadline_guard_ms": (0, 5, 50, 100),
    "max_attempts": (1, 2, 3, 8, 15),
    "award_repeat_ms": (20, 50, 300, 800, 2_000),
    "token_repeat_ms": (40, 100, 400, 800, 1_500),
    "drive_refresh_ms": (30, 80, 300, 450),
}
_OF_CAR_PARKS: dict[str, dict[str, Sequence[int]]] = {
    "[timing]": {"door_ms": (300, 1_000, 6_000, 12_000, 30_000), "grip_ms": (300, 1_000, 5_000, 9_000, 30_000)},
    "[carrier]": {
        "speed_mm_s": (300, 700, 1_500, 3_000, 5_000),
        "acceleration_mm_s2": (100, 250, 1_000, 2_500),
        "turn_ms": (0, 500, 8_000, 20_000, 60_000),
        "clearance_mm": (0, 100, 300, 800),
        "length_mm": (1_500, 2_000, 2_300),
    },
    "[shuttle]": {
        "speed_mm_s": (200, 400, 1_500),
        "acceleration_mm_s2": (100, 250, 1_000),
        "reach_mm": (3_000, 5_000, 7_000),
    },
    "[lift]": {"speed_mm_s": (200, 500, 2_000), "acceleration_mm_s2": (150, 500, 1_000)},
}
#: How many of the keys say something else than by default.
_SHARE = 0.4


def with_constants(tables: Tables, draw: random.Random, *, is_park: bool) -> Tables:
    """The tables of a site, with those of its constants drawn anew."""
    keys = {"[timing]": dict(_TIMING)}
    for header, more in _OF_CAR_PARKS.items() if is_park else ():
        keys.setdefault(header, {}).update(more)
    drawn: dict[str, dict[str, object]] = {}
    for header, values in keys.items():
        drawn[header] = {key: draw.choice(of) for key, of in values.items() if draw.random() < _SHARE}
    return [*(table for table in tables if table[0] not in drawn), *drawn.items()]

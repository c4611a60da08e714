"""Speeds, lengths, limits and times of a site file.

Default speeds are those of a SimPy simulation study of automated car parks (carrier 90 m/min, shuttle 45 m/min,
lift 65 m/min, places of 2.4 m by 5.4 m, 2.5 m a level). Accelerations, clearances, limits of cars and all
times are ours: plausible, and measured nowhere.
"""

from dataclasses import dataclass

from onboard.config.reader import Table
from onboard.core.negotiation.bidding import slot_length_us
from onboard.core.site import Axis, Timing
from onboard.systems.car_park.site import CarLimits

#: Longest classic frame with 29-bit identifier and 8 data bytes, bits (Davis, Burns, Bril and Lukkien 2007).
WORST_FRAME_BITS = 160
#: Shortest default of the bidding delay W, ms.
_SHORTEST_DELAY_MS = 300


@dataclass(frozen=True, slots=True)
class Constants:
    """What moves how fast, how large it is, and what cars are taken."""

    carrier: Axis
    carrier_length_mm: int
    carrier_clearance_mm: int
    carrier_turn_us: int
    shuttle: Axis
    shuttle_reach_mm: int
    lift: Axis
    cars: CarLimits


def read_constants(root: Table, lift: Table, pitch_mm: int) -> Constants:
    """``[carrier]``, ``[shuttle]``, ``[cars]``, and the speeds of ``[lift]``."""
    carrier, shuttle, cars = (root.table(name) for name in ("carrier", "shuttle", "cars"))
    length_mm = carrier.integer("length_mm", 100, 10_000, min(2_300, pitch_mm - 100))
    if length_mm > pitch_mm:
        carrier.bad("length_mm", length_mm, f"longer than a segment ({pitch_mm} mm)", "make floors.pitch_mm larger")
    return Constants(
        _read_axis(carrier, 1_500, 500),
        length_mm,
        carrier.integer("clearance_mm", 0, 20_000, 50),
        carrier.integer("turn_ms", 0, 60_000, 3_000) * 1000,
        _read_axis(shuttle, 750, 500),
        shuttle.integer("reach_mm", 500, 8_000, 5_400),
        _read_axis(lift, 1_083, 500),
        _read_cars(cars),
    )


def _read_axis(table: Table, speed_mm_s: int, acceleration_mm_s2: int) -> Axis:
    return Axis(
        table.integer("speed_mm_s", 10, 20_000, speed_mm_s),
        table.integer("acceleration_mm_s2", 10, 20_000, acceleration_mm_s2),
    )


def _read_cars(table: Table) -> CarLimits:
    """The wheelbases that the bus can carry (8 bits of 10 mm from 1500 mm) bound what a site can take."""
    limits = CarLimits(
        table.integer("min_wheelbase_mm", 1510, 4050, 1_800),
        table.integer("max_wheelbase_mm", 1510, 4050, 3_400),
        table.integer("max_length_mm", 1000, 8000, 5_300),
        table.integer("max_height_mm", 500, 4000, 2_100),
        table.integer("max_load_kg", 100, 4000, 3_000),
    )
    low_mm, high_mm = limits.min_wheelbase_mm, limits.max_wheelbase_mm
    if low_mm > high_mm and not table.wrong:
        name = "min_wheelbase_mm" if "min_wheelbase_mm" in table.values else "max_wheelbase_mm"
        what = f"min_wheelbase_mm {low_mm} is above max_wheelbase_mm {high_mm}"
        table.bad(name, table.values[name], what, "make the range the right way round")
    return limits


def read_timing(table: Table, robots: int, machines: int, bitrate: int) -> Timing:
    """``[timing]``, written in ms.

    The bidding delay W (design, section 4) is at least 3 N times the bus latency, N the robots and the latency that
    of two longest frames: one that has just begun to be sent, and one's own. The window must hold W, then one round of
    all machines' slots (``core.negotiation.bidding``), for a bid waits for its slot after W, and two guards, for no bid
    is sent after the second.
    """
    least_ms = -(-3 * robots * 2 * WORST_FRAME_BITS * 1000 // bitrate)
    window_ms = table.integer("call_window_ms", 50, 60_000, 1_000)
    delay_ms = table.integer("bid_delay_ms", 1, 60_000, max(_SHORTEST_DELAY_MS, least_ms))
    half_ms = table.integer("bid_half_ms", 1, 3_600_000, 10_000)
    guard_ms = table.integer("deadline_guard_ms", 0, 10_000, 20)
    if delay_ms < least_ms:
        what = f"shorter than 3 N times two frames at {bitrate} bit/s, N = {robots} robots"
        table.bad("bid_delay_ms", delay_ms, what, f"write at least {least_ms}")
    round_ms = -(-machines * slot_length_us(bitrate) // 1000)
    needed_ms = delay_ms + round_ms + 2 * guard_ms
    if needed_ms >= window_ms and not table.wrong:
        name = next((one for one in ("call_window_ms", "bid_delay_ms") if one in table.values), "deadline_guard_ms")
        what = (
            f"no room for bid_delay_ms {delay_ms}, {round_ms} ms of slots and twice deadline_guard_ms {guard_ms} in "
            f"call_window_ms {window_ms}"
        )
        table.bad(name, table.values.get(name), what, f"write call_window_ms = {needed_ms + 1} or more")
    return Timing(
        window_ms * 1000,
        delay_ms * 1000,
        half_ms * 1000,
        guard_ms * 1000,
        table.integer("max_attempts", 1, 15, 5),
        table.integer("award_repeat_ms", 10, 10_000, 100) * 1000,
        table.integer("token_repeat_ms", 10, 10_000, 200) * 1000,
        table.integer("heartbeat_ms", 100, 60_000, 2_000) * 1000,
        table.integer("bus_time_ms", 100, 60_000, 5_000) * 1000,
        table.integer("door_ms", 100, 60_000, 3_000) * 1000,
        table.integer("grip_ms", 100, 60_000, 2_000) * 1000,
        table.integer("drive_refresh_ms", 10, 450, 200) * 1000,
    )

"""Times of a site file. All defaults are plausible, and measured nowhere."""

from onboard.config.reader import TomlTable
from onboard.core.negotiation.bidding import slot_length_us
from onboard.work.timing import DeviceTiming

#: Longest classic frame with 29-bit identifier and 8 data bytes, bits (Davis, Burns, Bril and Lukkien 2007).
WORST_FRAME_BITS = 160
#: Shortest default of the bidding delay W, ms.
_SHORTEST_DELAY_MS = 300
#: Longest call window, ms: a last attempt has three times that, and no plan's stamp counts that is a minute ahead.
MOST_WINDOW_MS = 15_000


def read_timing(table: TomlTable, robots: int, machines: int, bitrate: int) -> DeviceTiming:
    """``[timing]``, written in ms.

    The bidding delay W (design, section 4) is at least 3 N times the bus latency, N the robots and the latency that
    of two longest frames: one that has just begun to be sent, and one's own. The window must hold W, then one round of
    all machines' slots (``core.negotiation.bidding``), for a bid waits for its slot after W, and two guards, for no bid
    is sent after the second.
    """
    least_ms = -(-3 * robots * 2 * WORST_FRAME_BITS * 1000 // bitrate)
    window_ms = table.integer("call_window_ms", 50, MOST_WINDOW_MS, 1_000)
    delay_ms = table.integer("bid_delay_ms", 1, MOST_WINDOW_MS, max(_SHORTEST_DELAY_MS, least_ms))
    half_ms = table.integer("bid_half_ms", 1, 3_600_000, 10_000)
    guard_ms = table.integer("deadline_guard_ms", 0, MOST_WINDOW_MS // 3, 20)
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
    return DeviceTiming(
        window_ms * 1000,
        delay_ms * 1000,
        half_ms * 1000,
        guard_ms * 1000,
        table.integer("max_attempts", 1, 15, 5),
        table.integer("award_repeat_ms", 10, 10_000, 100) * 1000,
        table.integer("token_repeat_ms", 10, 10_000, 200) * 1000,
        table.integer("heartbeat_ms", 100, 60_000, 2_000) * 1000,
        table.integer("bus_time_ms", 100, 60_000, 5_000) * 1000,
        table.integer("drive_refresh_ms", 10, 450, 200) * 1000,
        silent=table.choice("award", ["said", "silent"], "said") == "silent",
        door_us=table.integer("door_ms", 100, 60_000, 3_000) * 1000,
        grip_us=table.integer("grip_ms", 100, 60_000, 2_000) * 1000,
    )

"""Bounds of response times: published and hand-made sets, and random ones played on the simulated bus."""

import asyncio
import random
from functools import partial

import pytest

from bus_sim.can.bitstream import frame_length_bits, worst_case_length_bits
from bus_sim.can.medium import Medium
from bus_sim.can.node import NodeOptions, SimulatedBus
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.frame import Frame
from onboard.trace.frame_length import longest_frame_bits
from onboard.trace.response import ANYBODY, Stream, busy_period_us, fifo_bounds, priority_bounds, utilisation

RATE = 125_000


def a_stream(
    node: int, priority: int, period_us: int, *, bits: int = 125, burst: int = 1, jitter_us: int = 0
) -> Stream:
    """125 bits are 1 ms at 125 kbit/s."""
    return Stream(node, f"M{priority}", priority, bits, period_us, burst, jitter_us)


def of(streams: list[Stream], *, fifo: bool = False) -> list[int | None]:
    bounds = fifo_bounds(streams, RATE) if fifo else priority_bounds(streams, RATE)
    return [bound.response_us for bound in bounds]


# --- the published example -------------------------------------------------------------------------------------------

#: Table 1 of Davis, Burns, Bril and Lukkien 2007: seven data bytes under 11 bits, 1 ms each; 97 % of the bus.
REFUTING = [a_stream(1, 1, 2_500), a_stream(2, 2, 3_500), a_stream(3, 3, 3_500)]


def test_the_set_that_refuted_the_first_analysis_has_its_worst_response_in_the_second_instance() -> None:
    """The analysis of 1994 looks at C's first instance only: 3 ms, and so its deadline of 3.25 ms seemed to be met."""
    assert of(REFUTING) == [2_000, 3_000, 3_500]
    assert utilisation(REFUTING, RATE) == pytest.approx(0.9714, abs=1e-4)


def test_the_refuted_value_is_really_exceeded_on_the_bus() -> None:
    """C's second frame ends 3.5 ms after it was queued, all of them beginning together."""
    # Exact bits of these frames are fewer than the worst, so periods are stretched alike.
    frame = longest_frame(3)
    scale = frame_length_bits(frame) / 125
    streams = [
        Stream(s.node, s.name, s.priority, frame_length_bits(frame), round(s.period_us * scale), 1) for s in REFUTING
    ]
    worst = play(streams, [0, 0, 0], mailboxes=9, data=frame.data)
    assert worst["M3"] > round(3_250 * scale)
    assert worst["M3"] <= (of(streams)[2] or 0)


# --- by hand ---------------------------------------------------------------------------------------------------------


def test_a_frame_alone_takes_its_length_and_one_less_urgent_frame_may_just_have_begun() -> None:
    assert of([a_stream(1, 1, 10_000)]) == [1_000]
    assert of([a_stream(1, 1, 10_000), a_stream(2, 2, 10_000, bits=160)]) == [2_280, 2_280]


def test_the_last_of_a_burst_waits_for_its_own_and_jitter_brings_a_second_burst_at_once() -> None:
    assert of([a_stream(1, 1, 10_000, burst=4)]) == [4_000]
    assert of([a_stream(1, 1, 10_000, burst=4, jitter_us=10_000)]) == [8_000]
    assert of([a_stream(1, 2, 9_000), a_stream(2, 1, 9_000, burst=4, jitter_us=9_000)]) == [9_000, 9_000]


def test_in_a_first_in_first_out_queue_the_most_urgent_waits_for_the_least() -> None:
    """Urgent A behind D of its own node, which loses against B: A, D and B, whatever A's identifier."""
    streams = [a_stream(1, 1, 10_000), a_stream(1, 9, 10_000), a_stream(2, 5, 10_000)]
    assert of(streams) == [2_000, 3_000, 3_000]
    assert of(streams, fifo=True) == [3_000, 3_000, 3_000]


def test_frames_that_waited_in_another_nodes_queue_come_twice() -> None:
    """E waits up to 5 ms, so a second E can come 5 ms after the first's late start: the bus is busy until then."""
    streams = [a_stream(1, 1, 5_000), a_stream(2, 2, 40_000, burst=8)]
    assert of(streams, fifo=True) == of(streams, fifo=True)
    first, second = of(streams, fifo=True)
    assert first == 2_000, "one frame of B has begun"
    assert busy_period_us(streams, RATE) == 10_000 == second, "eight of B, and A at 0 and at 5 ms"


def test_a_stream_of_whichever_node_has_the_bound_of_the_worst_node() -> None:
    streams = [a_stream(1, 1, 20_000), a_stream(2, 9, 20_000, burst=3), a_stream(ANYBODY, 5, 20_000)]
    node_1, node_2, anybody = of(streams, fifo=True)
    assert anybody == max(node_1 or 0, node_2 or 0) == 5_000


def test_more_than_the_bus_can_carry_has_no_bound_but_for_what_is_urgent_enough() -> None:
    streams = [a_stream(1, 1, 4_000), a_stream(2, 2, 2_000), a_stream(3, 3, 2_000)]
    assert of(streams) == [2_000, 3_000, None]
    assert of(streams, fifo=True) == [None] * 3
    assert busy_period_us(streams, RATE) is None
    assert [bound.is_met for bound in priority_bounds(streams, RATE)] == [True, False, False]


@pytest.mark.parametrize(("name", "value"), [("burst", 0), ("bits", 0), ("period_us", 0), ("jitter_us", -1)])
def test_what_is_no_stream_is_refused(name: str, value: int) -> None:
    values = {"bits": 100, "period_us": 1_000, "burst": 1, "jitter_us": 0, name: value}
    with pytest.raises(ValueError, match=name):
        Stream(1, "M", 1, **values)


def test_a_bus_without_a_bit_rate_is_refused() -> None:
    with pytest.raises(ValueError, match="bit rate 0"):
        priority_bounds([a_stream(1, 1, 1_000)], 0)


def test_a_bus_so_full_that_it_is_busy_for_a_minute_counts_as_never_idle() -> None:
    """9,999 of 10,000 bit times taken, in bursts of several minutes."""
    streams = [a_stream(node, node, 100_000_000, burst=33_330) for node in (1, 2, 3)]
    assert utilisation(streams, RATE) < 1
    assert busy_period_us(streams, RATE) is None
    assert of(streams, fifo=True) == [None] * 3
    assert of(streams)[2] is None


# --- against the simulated bus ---------------------------------------------------------------------------------------


def longest_frame(priority: int) -> Frame:
    return Frame(priority, bytes([0x3C] * 8))


def play(
    streams: list[Stream], phases_us: list[int], *, mailboxes: int, data: bytes = bytes([0x3C] * 8)
) -> dict[str, int]:
    """Worst response of each stream on the simulated bus, bursts sent as early as they may be, from their phases on."""
    loop = VirtualTimeLoop()
    try:
        worst = _set_up(loop, streams, phases_us, mailboxes, data)
        loop.run_until_complete(asyncio.sleep(2))
    finally:
        loop.close()
    return worst


def _set_up(
    loop: VirtualTimeLoop, streams: list[Stream], phases_us: list[int], mailboxes: int, data: bytes
) -> dict[str, int]:
    medium = Medium(loop, bit_rate=RATE)
    options = NodeOptions(mailboxes=mailboxes)
    nodes = {node: medium.attach(str(node), node, options=options) for node in sorted({s.node for s in streams})}
    medium.attach("listener")
    waiting: dict[int, list[int]] = {stream.priority: [] for stream in streams}
    worst = dict.fromkeys((stream.name for stream in streams), 0)

    def on_end(frame: Frame, time_us: int, _: str) -> None:
        name = f"M{frame.arbitration_id}"
        worst[name] = max(worst[name], time_us - waiting[frame.arbitration_id].pop(0))

    medium.tap_queues(lambda frame, time_us, _: waiting[frame.arbitration_id].append(time_us))
    medium.tap(on_end)
    for stream, phase_us in zip(streams, phases_us, strict=True):
        for number in range(12):
            when_us = phase_us + max(0, number * stream.period_us - stream.jitter_us)
            for _ in range(stream.burst):
                loop.at_us(when_us, partial(_send, nodes[stream.node], Frame(stream.priority, data)))
    return worst


def _send(bus: SimulatedBus, frame: Frame, _when_us: int) -> None:
    bus.send(frame)


def random_streams(chance: random.Random) -> list[Stream]:
    """A few nodes with some messages each that fill a third to nine tenths of the bus."""
    streams = [
        Stream(
            chance.randint(1, 4),
            f"M{priority}",
            priority,
            frame_length_bits(longest_frame(priority)),
            chance.choice([8_000, 13_000, 20_000, 34_000, 55_000]),
            chance.randint(1, 4),
            chance.choice([0, 0, 3_000, 9_000]),
        )
        for priority in chance.sample(range(1, 200), chance.randint(3, 7))
    ]
    return streams if 0.3 < utilisation(streams, RATE) < 0.9 else random_streams(chance)


@pytest.mark.parametrize("fifo", [True, False])
def test_no_frame_on_the_simulated_bus_is_later_than_its_bound(fifo: bool) -> None:
    chance = random.Random(7)
    reached = []
    for _ in range(25):
        streams = random_streams(chance)
        bounds = (fifo_bounds if fifo else priority_bounds)(streams, RATE)
        for phases in ([0] * len(streams), [chance.randrange(20_000) for _ in streams]):
            worst = play(streams, phases, mailboxes=1 if fifo else 100)
            for bound in bounds:
                assert bound.response_us is not None
                assert worst[bound.stream.name] <= bound.response_us, (bound, streams)
                reached.append(worst[bound.stream.name] / bound.response_us)
    assert max(reached) > 0.95, "and the bounds are no wider than they need be"


def test_an_urgent_frame_behind_its_own_nodes_queue_is_later_than_priority_alone_would_allow() -> None:
    """Why the analysis must be that of the queue that a node has: with the other one the bound would be broken."""
    bits = frame_length_bits(longest_frame(1))
    streams = [
        Stream(1, "M9", 9, bits, 50_000, 6),
        Stream(1, "M1", 1, bits, 50_000),
        Stream(2, "M5", 5, bits, 50_000, 6),
    ]
    worst = play(streams, [0, 100, 0], mailboxes=1)
    by_priority, by_queue = of(streams)[1], of(streams, fifo=True)[1]
    assert by_priority is not None and by_queue is not None
    assert by_priority < worst["M1"] <= by_queue


# --- frame lengths ---------------------------------------------------------------------------------------------------


def test_the_longest_frame_of_an_identifier_is_never_exceeded_and_never_above_the_papers_bound() -> None:
    chance = random.Random(3)
    runs = [0x00, 0xFF, 0x0F, 0xF0, 0x1E, 0xE1, 0x78, 0x87, 0x3C, 0xC3]
    closest = 99
    for _ in range(4_000):
        identifier, length = chance.getrandbits(29), chance.randint(0, 8)
        data = bytes(chance.choice([chance.randrange(256), *runs]) for _ in range(length))
        longest = longest_frame_bits(identifier, length)
        exact = frame_length_bits(Frame(identifier, data))
        assert exact <= longest <= worst_case_length_bits(length, is_extended=True)
        closest = min(closest, longest - exact)
    assert closest <= 1


def test_the_longest_frame_over_all_data_of_one_byte_is_found_to_a_bit() -> None:
    for identifier in (0x00010001, 0x0C41000B, 0x1EF000FA):
        exact = max(frame_length_bits(Frame(identifier, bytes([value]))) for value in range(256))
        assert exact <= longest_frame_bits(identifier, 1) <= exact + 3


@pytest.mark.parametrize(("identifier", "length"), [(1 << 29, 8), (-1, 8), (1, 9)])
def test_what_is_no_frame_has_no_length(identifier: int, length: int) -> None:
    with pytest.raises(ValueError, match="no classic frame"):
        longest_frame_bits(identifier, length)

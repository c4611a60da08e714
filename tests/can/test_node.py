from itertools import pairwise

import pytest

from bus_sim.can.bitstream import frame_length_bits
from bus_sim.can.node import AcceptanceFilter, NodeOptions
from onboard.core.frame import Frame
from tests.can.rig import Rig, ext, std

BIT_US = 2


def test_filters_compare_value_mask_and_format(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b", filters=[AcceptanceFilter(0x18000005, 0x1F0000FF), AcceptanceFilter(0x7, 0x7FF, extended=False)])
    for frame in (ext(0x18FFFF05), ext(0x18FFFF06), ext(0x7), std(0x7), std(0x8), std(0x7, remote_dlc=1)):
        a.send(frame)
    rig.run(20_000)
    assert [frame for _time, frame in rig.heard["b"]] == [ext(0x18FFFF05), std(0x7), std(0x7, remote_dlc=1)]


def test_filters_may_change_while_the_bus_runs(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")
    a.send(ext(0x100))
    rig.run(1_000)
    b.set_filters([AcceptanceFilter(0x200, 0xFFF)])
    a.send(ext(0x100))
    a.send(ext(0x200))
    rig.run(1_000)
    assert [frame.arbitration_id for _time, frame in rig.heard["b"]] == [0x100, 0x200]
    assert b.health().received == 2


def test_a_filtered_frame_is_still_acknowledged(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b", filters=[AcceptanceFilter(0x1, 0x1FFFFFFF)])
    a.send(ext(0x100))
    rig.run(1_000)
    assert len(rig.confirmed["a"]) == 1
    assert rig.heard["b"] == []


def test_a_slow_processor_overflows_and_counts(rig: Rig) -> None:
    a = rig.node("a")
    slow = rig.node("slow", options=NodeOptions(receive_queue=3, processing_us=1_000))
    rig.node("fast")
    frames = [ext(0x100, bytes((number,) * 8)) for number in range(10)]
    for frame in frames:
        a.send(frame)
    rig.run(20_000)
    heard = [frame for _time, frame in rig.heard["slow"]]
    # Frames take 0.3 ms each, the processor 1 ms: it falls behind, and what came when the queue was full is gone.
    assert heard[:3] == frames[:3]
    assert len(heard) < 10
    assert slow.health().received == len(heard)
    assert slow.health().receive_overflows == 10 - len(heard)
    times = [time for time, _frame in rig.heard["slow"]]
    assert times[0] == rig.log[0][0] + 1_000
    assert min(b - a for a, b in pairwise(times)) >= 1_000
    assert [frame for _time, frame in rig.heard["fast"]] == frames


def test_a_processor_may_become_slow_and_fast_again(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")
    b.processing_us = 5_000
    for number in range(3):
        a.send(ext(0x100 + number))
    rig.run(2_000)
    assert rig.heard["b"] == []
    b.processing_us = 0
    a.send(ext(0x200))
    rig.run(20_000)
    assert [frame.arbitration_id for _time, frame in rig.heard["b"]] == [0x100, 0x101, 0x102, 0x200]


def test_all_receivers_get_the_very_same_object(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    rig.node("c")
    frame = ext(0x100, b"\x01")
    a.send(frame)
    rig.run(1_000)
    assert rig.heard["b"][0][1] is frame
    assert rig.heard["c"][0][1] is frame


def test_the_transmit_queue_is_bounded_and_counts_what_it_refuses(rig: Rig) -> None:
    a = rig.node("a", options=NodeOptions(mailboxes=2, transmit_queue=3))
    rig.node("b")
    assert [a.send(ext(number)) for number in range(7)] == [True] * 5 + [False] * 2
    assert a.waiting_to_send == 5
    rig.run(10_000)
    assert a.waiting_to_send == 0
    assert len(rig.heard["b"]) == 5
    assert a.health().send_refused == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"mailboxes": 0}, "mailboxes=0"),
        ({"transmit_queue": 0}, "transmit_queue=0"),
        ({"receive_queue": -1}, "receive_queue=-1"),
        ({"processing_us": -1}, "must not be negative"),
        ({"restart_after_us": -1}, "must not be negative"),
    ],
)
def test_options_that_no_node_can_have(options: dict[str, int], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        NodeOptions(**options)  # type: ignore[arg-type]  # bad values are the point


def test_load_of_the_bus(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    frame = ext(0x100, bytes(8))
    bits = frame_length_bits(frame)

    def burst(count: int) -> None:
        for _ in range(count):
            a.send(frame)

    burst(100)
    rig.run(1_000_000)
    burst(300)
    rig.run(1_000_000)
    burst(200)
    rig.run(2_000_000)
    statistics = rig.medium.statistics()
    assert statistics.frames == 600
    assert statistics.busy_bits == 600 * bits
    assert statistics.worst_second_load == pytest.approx(300 * bits / 500_000)
    assert statistics.mean_load == pytest.approx(600 * bits / 2_000_000)


def test_load_is_split_where_a_frame_crosses_a_second(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    for _ in range(1_000):
        a.send(ext(0x1, b"\x55" * 8))

    def keep_full(_frame: Frame, _time_us: int) -> None:
        a.send(ext(0x1, b"\x55" * 8))

    a.subscribe(lambda _frame, _time_us: None, keep_full)
    rig.run(3_000_000)
    assert rig.medium.statistics().worst_second_load <= 1.0
    assert rig.medium.statistics().mean_load == pytest.approx(1.0, abs=0.001)


def test_a_sender_of_very_many_identifiers_is_counted_right(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")
    count = 17_000

    def next_frame(frame: Frame, _time_us: int) -> None:
        if frame.arbitration_id + 1 < count:
            a.send(ext(frame.arbitration_id + 1))

    a.subscribe(lambda _frame, _time_us: None, next_frame)
    a.send(ext(0))
    rig.run(5_000_000)
    assert b.health().received == a.health().sent == len(rig.heard["b"]) == count

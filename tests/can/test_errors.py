from contextlib import closing
from itertools import pairwise

import pytest

from bus_sim.can.bitstream import frame_length_bits, stuffed_bits
from bus_sim.can.error_frames import (
    CAN_ERR_ACK,
    CAN_ERR_BUSOFF,
    CAN_ERR_CRTL,
    CAN_ERR_PROT,
    CAN_ERR_RESTARTED,
)
from bus_sim.can.faults import FaultKind, InjectedFault, parse_fault
from bus_sim.can.medium import Medium
from bus_sim.can.node import NodeOptions
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.ports.bus import ErrorState
from tests.can.conftest import MakeRig
from tests.can.rig import Rig, ext

BIT_US = 2
FRAME = ext(0x123456, bytes(range(8)))


def every_frame(until_us: int | None = None, receivers: tuple[str, ...] = (), nth: int | None = None) -> InjectedFault:
    return InjectedFault(FaultKind.CORRUPTION, receivers=receivers, until_us=until_us, nth=nth)


def test_a_lone_node_repeats_for_ever_becomes_passive_and_never_leaves_the_bus(rig: Rig) -> None:
    a = rig.node("a")
    a.send(FRAME)
    rig.run(1_000_000)
    assert a.health().state is ErrorState.ERROR_PASSIVE
    assert a.health().tec == 128
    assert a.health().sent == 0
    assert rig.confirmed["a"] == []
    assert len(rig.errors()) > 1_000
    assert all(frame.arbitration_id & CAN_ERR_ACK for _time, frame in rig.errors())


def test_time_between_repetitions_without_ack(rig: Rig) -> None:
    rig.node("a").send(FRAME)
    rig.run(100_000)
    # Up to and with the ACK slot, six bits of flag, eight of delimiter, three of intermission.
    active = (frame_length_bits(FRAME) - 11 + 6 + 8 + 3) * BIT_US
    suspended = active + 8 * BIT_US
    times = [time for time, _frame in rig.errors()]
    assert times[0] == (frame_length_bits(FRAME) - 11) * BIT_US
    assert {b - a for a, b in pairwise(times[:16])} == {active}
    assert {b - a for a, b in pairwise(times[16:41])} == {suspended}


def test_the_frame_leaves_once_somebody_joins(rig: Rig) -> None:
    a = rig.node("a")
    a.send(FRAME)
    rig.run(50_000)
    b = rig.node("b")
    rig.run(50_000)
    assert [frame for _time, frame in rig.heard["b"]] == [FRAME]
    assert len(rig.confirmed["a"]) == 1
    assert a.health().tec == 127
    assert a.health().state is ErrorState.ERROR_ACTIVE
    assert b.health().rec == 0


def test_a_tap_does_not_acknowledge(rig: Rig) -> None:
    rig.medium.tap(lambda _frame, _time, _sender: None)
    rig.node("a").send(FRAME)
    rig.run(10_000)
    assert rig.frames() == []


def test_one_corruption_is_repaired_by_the_repetition(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame(nth=1)])
    a, b = rig.node("a"), rig.node("b")
    a.send(FRAME)
    rig.run(10_000)
    assert [frame for _time, frame in rig.heard["b"]] == [FRAME]
    assert len(rig.errors()) == 1
    # 8 up and one down for the transmitter, one up and one down for the receiver.
    assert (a.health().tec, b.health().rec) == (7, 0)
    statistics = rig.medium.statistics()
    assert (statistics.frames, statistics.error_frames) == (1, 1)


def test_where_an_error_flag_ends(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame(nth=1)])
    a = rig.node("a")
    rig.node("b")
    a.send(FRAME)
    rig.run(10_000)
    detected_us, good_us = rig.errors()[0][0], rig.log[-1][0]
    position = detected_us // BIT_US - 1
    wire = stuffed_bits(FRAME)
    wire[position] ^= 1
    run = 0
    while run <= position and wire[position - run] == 0:
        run += 1
    # Receivers notice six dominant bits in a row and then send six of their own.
    flags = max(6, 6 - run + 6)
    restart_us = detected_us + (flags + 8 + 3) * BIT_US
    assert good_us == restart_us + (frame_length_bits(FRAME) - 3) * BIT_US


def test_from_active_to_passive_to_off_the_bus(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame()])
    a, b = rig.node("a", options=NodeOptions(restart_after_us=None)), rig.node("b")
    a.send(FRAME)
    rig.run(50_000)
    errors = rig.errors()
    assert len(errors) == 32
    assert [frame.data[6] for _time, frame in errors[:3]] == [8, 16, 24]
    passive = [bool(frame.arbitration_id & CAN_ERR_CRTL) for _time, frame in errors]
    assert passive == [False] * 15 + [True] * 16 + [False]
    assert errors[-1][1].arbitration_id & CAN_ERR_BUSOFF
    assert errors[-1][1].arbitration_id & CAN_ERR_PROT
    assert a.health().state is ErrorState.BUS_OFF
    assert b.health().rec == 32


def test_a_node_comes_back_by_itself_and_sends_what_it_held(make_rig: MakeRig) -> None:
    dry_run = make_rig(faults=[every_frame()])
    dry_run.node("a", options=NodeOptions(restart_after_us=None)).send(FRAME)
    dry_run.node("b")
    dry_run.run(50_000)
    off_us = dry_run.errors()[-1][0]

    rig = make_rig(faults=[every_frame(until_us=off_us)])
    a = rig.node("a")
    rig.node("b")
    a.send(FRAME)
    rig.run(off_us + 10_000)
    back_us, back = rig.errors()[-1]
    assert back.arbitration_id & CAN_ERR_RESTARTED
    # 128 times eleven recessive bits, the first of them delimiter and intermission after the last flag (6 to 12 bits).
    assert 0 <= back_us - off_us - (6 + 128 * 11) * BIT_US <= 6 * BIT_US
    assert [frame for _time, frame in rig.heard["b"]] == [FRAME]
    assert a.health().state is ErrorState.ERROR_ACTIVE
    assert a.health().tec == 0


def test_a_node_off_the_bus_hears_nothing_acknowledges_nothing_and_keeps_its_queue(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[InjectedFault(FaultKind.CORRUPTION, id_value=1, id_mask=0xFF, until_us=20_000)])
    a, b = rig.node("a", options=NodeOptions(restart_after_us=None)), rig.node("b")
    a.send(ext(0x101))
    rig.run(30_000)
    assert a.health().state is ErrorState.BUS_OFF
    assert a.send(ext(0x201)) is True
    b.send(ext(0x302))
    rig.run(100_000)
    assert rig.heard["a"] == []
    assert b.health().sent == 0
    assert b.health().tec == 128
    a.restart()
    rig.run(100_000)
    assert {frame.arbitration_id for frame in rig.frames()} == {0x101, 0x201, 0x302}
    assert a.health().state is ErrorState.ERROR_ACTIVE


def test_recovery_on_a_busy_bus_takes_128_frames(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[InjectedFault(FaultKind.CORRUPTION, id_value=1, id_mask=0xFF, until_us=50_000)])
    a, b = rig.node("a", options=NodeOptions(restart_after_us=None)), rig.node("b")
    rig.node("c")
    a.send(ext(0x101))
    rig.run(50_000)
    assert a.health().state is ErrorState.BUS_OFF
    for number in range(300):
        b.send(ext(0x200, bytes((number % 256,)) * 8))
    rig.run(10_000)
    begin_us = rig.loop.now_us()
    a.restart()
    rig.run(100_000)
    back_us = rig.errors()[-1][0]
    assert sum(1 for time, frame, _sender in rig.log if begin_us < time <= back_us and not frame.is_error) == 128


def test_two_senders_of_one_identifier_with_different_data_destroy_each_others_frames(rig: Rig) -> None:
    a, b, c = rig.node("a"), rig.node("b"), rig.node("c")
    a.send(ext(0x100, b"\x00"))
    b.send(ext(0x100, b"\x01"))
    rig.run(50_000)
    collisions = len(rig.errors())
    # Sixteen times 8 makes both error-passive; then the one that sends dominant no longer notices the other.
    assert collisions == 16
    assert rig.frames() == [ext(0x100, b"\x00"), ext(0x100, b"\x01")]
    assert a.health().tec == 127
    assert b.health().tec == 135
    assert c.health().rec == 14


def test_two_senders_of_one_frame_send_it_once(rig: Rig) -> None:
    rig.node("a").send(FRAME)
    rig.node("b").send(FRAME)
    rig.node("c")
    rig.run(10_000)
    assert rig.frames() == [FRAME]
    assert [len(rig.confirmed[name]) for name in "abc"] == [1, 1, 0]
    assert [len(rig.heard[name]) for name in "abc"] == [0, 0, 1]


def test_a_passive_transmitter_lets_others_go_first(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame(until_us=4_000)])
    a, b = rig.node("a"), rig.node("b")
    a.send(ext(0x100, b"\xaa" * 8))
    rig.run(4_000)
    assert a.health().state is ErrorState.ERROR_PASSIVE
    rig.at(rig.loop.now_us(), b, ext(0x1FFFFF00))
    rig.run(10_000)
    # The lowest priority there is goes first: a must wait eight bits longer after its failed attempt.
    assert [frame.arbitration_id for frame in rig.frames()] == [0x1FFFFF00, 0x100]


def test_an_active_receiver_with_a_wrong_crc_destroys_the_frame_for_all(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame(receivers=("b",), nth=1)])
    a, b, c = rig.node("a"), rig.node("b"), rig.node("c")
    a.send(FRAME)
    rig.run(10_000)
    assert len(rig.errors()) == 1
    assert [len(rig.heard[name]) for name in "bc"] == [1, 1]
    # It flagged first and saw the others follow: 1 + 8, and one down for the repetition.
    assert (a.health().tec, b.health().rec, c.health().rec) == (7, 8, 0)


def test_a_passive_receiver_with_a_wrong_crc_only_misses_the_frame(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame(receivers=("b",), until_us=10_000)])
    a, b = rig.node("a"), rig.node("b")
    rig.node("c")
    for number in range(20):
        a.send(ext(0x100 + number))
    rig.run(20_000)
    # 15 times 9 is more than 127: from then on b is passive, and the bus goes on without it.
    assert len(rig.errors()) == 15
    assert len(rig.heard["c"]) == 20
    assert rig.heard["b"] == []
    assert b.health().state is ErrorState.ERROR_PASSIVE


def test_a_node_that_vanishes_breaks_its_frame_off(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")
    rig.node("c")
    a.send(FRAME)
    rig.run(100)
    a.power_off()
    b.send(ext(0x42))
    rig.run(10_000)
    # 50 bits were out; six recessive bits later the others notice.
    assert rig.errors()[0][0] == 100 + 6 * BIT_US
    assert rig.frames() == [ext(0x42)]
    assert [len(rig.heard[name]) for name in "abc"] == [0, 0, 1]
    assert a.send(FRAME) is False


def test_a_node_that_closes_finishes_its_frame_and_drops_the_rest(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    a.send(FRAME)
    a.send(ext(0x1))
    rig.run(100)
    rig.loop.run_until_complete(a.close())
    rig.run(10_000)
    assert [frame for _time, frame in rig.heard["b"]] == [FRAME]
    assert rig.errors() == []
    assert rig.confirmed["a"] == []


def test_a_node_that_leaves_within_a_handler_is_not_called_any_more(rig: Rig) -> None:
    a, b, c = rig.node("a"), rig.node("b"), rig.medium.attach("c")
    heard = []
    b.subscribe(lambda _frame, _time: c.power_off())
    c.subscribe(lambda frame, _time: heard.append(frame))
    a.send(FRAME)
    rig.run(10_000)
    assert heard == []


def test_a_node_that_joins_during_a_frame_does_not_hear_it(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    a.send(FRAME)
    a.send(ext(0x7))
    rig.run(100)
    rig.node("c")
    rig.run(10_000)
    assert [frame for _time, frame in rig.heard["c"]] == [ext(0x7)]


def test_names_are_unique_and_free_again_after_leaving(rig: Rig) -> None:
    a = rig.node("a")
    with pytest.raises(ValueError, match="'a' is attached already"):
        rig.medium.attach("a")
    a.power_off()
    rig.node("a").send(FRAME)
    rig.node("b")
    rig.run(10_000)
    assert rig.frames() == [FRAME]


def test_error_frames_reach_nodes_that_asked_for_them(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[parse_fault("corruption:nth=1")])
    a = rig.node("a")
    rig.node("b")
    rig.node("monitor", options=NodeOptions(receive_errors=True))
    a.send(FRAME)
    rig.run(10_000)
    assert [frame.is_error for _time, frame in rig.heard["monitor"]] == [True, False]
    assert [frame.is_error for _time, frame in rig.heard["b"]] == [False]


@pytest.mark.parametrize("bit_rate", [0, 999, 1_000_001])
def test_a_bit_rate_that_can_cannot_have(bit_rate: int) -> None:
    with closing(VirtualTimeLoop()) as loop, pytest.raises(ValueError, match=f"bit rate {bit_rate}"):
        Medium(loop, bit_rate=bit_rate)


def test_a_reception_brings_a_passive_receiver_straight_back(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[every_frame(receivers=("b",), until_us=10_000)])
    a, b = rig.node("a"), rig.node("b")
    rig.node("c")
    for number in range(20):
        a.send(ext(0x100 + number))
    rig.run(20_000)
    assert b.health().rec > 127
    a.send(FRAME)
    rig.run(1_000)
    assert b.health().rec == 127
    assert b.health().state is ErrorState.ERROR_ACTIVE
    assert rig.heard["b"][-1][1] == FRAME

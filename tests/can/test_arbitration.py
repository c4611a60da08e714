from hypothesis import given
from hypothesis import strategies as st

from bus_sim.can.arbitration import arbitration_key, first_difference
from bus_sim.can.bitstream import frame_length_bits, header_bits
from bus_sim.can.node import NodeOptions
from onboard.core.frame import Frame
from tests.can.rig import Rig, ext, std
from tests.can.test_bitstream import frames

# 500 kbit/s: one bit is 2 us; the three bits of intermission come after the end that a receiver sees.
BIT_US = 2
INTERMISSION_US = 3 * BIT_US


def duration_us(frame: Frame) -> int:
    return frame_length_bits(frame) * BIT_US


@given(frames(), frames())
def test_the_key_orders_as_the_bits_do(one: Frame, other: Frame) -> None:
    def field(frame: Frame) -> list[int]:
        bits = header_bits(frame)
        return bits[1:33] if frame.is_extended else bits[1:14]

    length = min(len(field(one)), len(field(other)))
    a, b = field(one)[:length], field(other)[:length]
    if a != b:
        assert (arbitration_key(one) < arbitration_key(other)) == (a < b)


def test_of_one_base_identifier_data_beats_remote_and_standard_beats_extended(rig: Rig) -> None:
    base = 0x155
    contenders = [
        ext(base << 18, remote_dlc=0),
        ext(base << 18 | 1),
        ext(base << 18),
        std(base, remote_dlc=2),
        std(base, b"\x01"),
        ext((base << 18) - 1),
    ]
    for index, frame in enumerate(contenders):
        rig.at(0, rig.node(f"N{index}"), frame)
    rig.run(10_000)
    order = [contenders[index] for index in (5, 4, 3, 2, 0, 1)]
    assert rig.frames() == order


def test_times_are_exact(rig: Rig) -> None:
    first, second = ext(0x100, bytes(range(8))), ext(0x101, b"\xff" * 8)
    a, b = rig.node("a"), rig.node("b")
    rig.at(1_000, b, second)
    rig.at(1_000, a, first)
    rig.run(10_000)
    first_end = 1_000 + duration_us(first) - INTERMISSION_US
    second_end = 1_000 + duration_us(first) + duration_us(second) - INTERMISSION_US
    assert rig.log == [(first_end, first, "a"), (second_end, second, "b")]
    assert rig.heard["b"] == [(first_end, first)]
    assert rig.confirmed["a"] == [(first_end, first)]


def test_a_bit_rate_that_does_not_divide_a_microsecond_does_not_drift(make_rig: type[Rig]) -> None:
    rig = make_rig(bit_rate=83_333)
    a = rig.node("a")
    rig.node("b")
    frame = ext(0x1ABCDEF, b"\x12\x34")
    for _ in range(500):
        a.send(frame)
    rig.run(2_000_000)
    bits = 500 * frame_length_bits(frame) - 3
    assert rig.log[-1][0] == -(-bits * 1_000_000 // 83_333)


def test_who_is_ready_within_the_start_bit_takes_part(rig: Rig) -> None:
    a, b, c = rig.node("a"), rig.node("b"), rig.node("c")
    rig.at(100, a, ext(0x300))
    rig.at(101, b, ext(0x200))
    rig.at(100 + BIT_US + 1, c, ext(0x100))
    rig.run(10_000)
    # The first two share a start bit, so the better one wins; the third comes a bit late, and next.
    assert [sender for _time, _frame, sender in rig.log] == ["b", "c", "a"]
    assert rig.log[0][0] == 100 + duration_us(ext(0x200)) - INTERMISSION_US


def test_an_answer_in_intermission_competes_for_the_next_start(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")

    def answer(frame: Frame, _time_us: int) -> None:
        if frame.arbitration_id == 0x100:
            b.send(ext(0x50))

    b.subscribe(answer)
    a.send(ext(0x100))
    a.send(ext(0x101))
    rig.run(10_000)
    assert [frame.arbitration_id for frame in rig.frames()] == [0x100, 0x50, 0x101]


def test_mailboxes_compete_and_the_queue_behind_them_does_not(rig: Rig) -> None:
    a = rig.node("a", options=NodeOptions(mailboxes=2))
    rig.node("b")
    for identifier in (0x500, 0x400, 0x300, 0x200):
        a.send(ext(identifier))
    rig.run(10_000)
    # 0x500 and 0x400 are in mailboxes; each free one takes the oldest of the queue.
    assert [frame.arbitration_id for frame in rig.frames()] == [0x400, 0x300, 0x200, 0x500]


def test_with_one_mailbox_a_low_priority_frame_holds_up_its_node(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")
    for identifier in (0x500, 0x100):
        a.send(ext(identifier))
    b.send(ext(0x300))
    rig.run(10_000)
    assert [frame.arbitration_id for frame in rig.frames()] == [0x300, 0x500, 0x100]


def test_first_difference_names_who_sent_recessive() -> None:
    zero, one = ext(0x100, b"\x55"), ext(0x100, b"\x57")
    collision = first_difference([one, zero])
    assert collision is not None
    assert collision.recessive == (0,)
    assert first_difference([one, one]) is None


@given(st.lists(st.tuples(st.integers(0, 5), frames()), min_size=1, max_size=30))
def test_what_is_pending_together_goes_by_priority(sends: list[tuple[int, Frame]]) -> None:
    # The sender is made part of the identifier, as the contract demands of a fleet.
    rig = Rig()
    try:
        nodes = [rig.node(f"N{index}", options=NodeOptions(mailboxes=30)) for index in range(6)]
        rig.node("listener")
        sent = []
        for index, frame in sends:
            top = frame.arbitration_id & (0x1FFFFF00 if frame.is_extended else 0x700)
            own = frame._replace(arbitration_id=top | index)
            assert nodes[index].send(own)
            sent.append(own)
        rig.run(60_000)
        assert rig.frames() == sorted(sent, key=arbitration_key)
        assert [frame for _time, frame in rig.heard["listener"]] == rig.frames()
    finally:
        rig.close()


@given(
    st.lists(
        st.tuples(st.integers(0, 4_000), st.integers(0, 4), st.integers(0, 0x1FFFFF), st.binary(max_size=8)),
        min_size=1,
        max_size=40,
    )
)
def test_nothing_is_lost_and_everybody_hears_the_same(sends: list[tuple[int, int, int, bytes]]) -> None:
    rig = Rig()
    try:
        nodes = [rig.node(f"N{index}") for index in range(5)]
        for when_us, index, identifier, data in sends:
            rig.at(when_us, nodes[index], ext(identifier << 8 | index, data))
        rig.run(60_000)
        assert rig.errors() == []
        for index in range(5):
            own = [ext(identifier << 8 | i, data) for _when, i, identifier, data in sends if i == index]
            assert sorted(frame for _time, frame in rig.confirmed[f"N{index}"]) == sorted(own)
            others = [(time, frame) for time, frame, sender in rig.log if sender != f"N{index}"]
            assert rig.heard[f"N{index}"] == others
        assert len(rig.log) == len(sends)
        busy = sum(frame_length_bits(frame) for frame in rig.frames())
        assert rig.medium.statistics().busy_bits == busy
    finally:
        rig.close()

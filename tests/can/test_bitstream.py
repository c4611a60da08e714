from itertools import groupby, pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus_sim.can.bitstream import frame_length_bits, stuffed_bits, worst_case_length_bits
from onboard.core.frame import Frame

VECTORS = Path(__file__).parents[1] / "vectors" / "can_frame_lengths.txt"


def read_vectors() -> list[tuple[Frame, int]]:
    vectors = []
    for line in VECTORS.read_text(encoding="ascii").splitlines():
        if line.startswith("#"):
            continue
        text, bits = line.split(" ")
        identifier, body = text.split("#")
        is_remote = body == "R"
        data = b"" if is_remote else bytes.fromhex(body)
        vectors.append((Frame(int(identifier, 16), data, len(identifier) == 8, is_remote), int(bits)))
    return vectors


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    is_extended = draw(st.booleans())
    identifier = draw(st.integers(0, 0x1FFFFFFF if is_extended else 0x7FF))
    if draw(st.booleans()):
        return Frame(identifier, b"", is_extended, True, remote_dlc=draw(st.integers(0, 8)))
    stuffing = st.sampled_from([0x00, 0xFF, 0x0F, 0xF0, 0x87, 0x78, 0x3C, 0xC3, 0x1F, 0xE0])
    data = bytes(draw(st.lists(st.one_of(stuffing, st.integers(0, 255)), max_size=8)))
    return Frame(identifier, data, is_extended)


def test_lengths_equal_those_of_can_utils() -> None:
    vectors = read_vectors()
    assert len(vectors) > 500
    assert [(frame, frame_length_bits(frame)) for frame, _bits in vectors] == vectors


@given(frames())
def test_the_fast_length_is_that_of_the_bits(frame: Frame) -> None:
    # CRC delimiter, ACK slot and delimiter, seven bits end of frame, three bits intermission.
    assert frame_length_bits(frame) == len(stuffed_bits(frame)) + 1 + 2 + 7 + 3


@given(frames())
def test_never_six_equal_bits_in_a_row(frame: Frame) -> None:
    assert max(len(list(run)) for _bit, run in groupby(stuffed_bits(frame))) <= 5


@given(frames())
def test_a_receiver_that_takes_out_the_stuff_bits_finds_a_good_crc(frame: Frame) -> None:
    plain: list[int] = []
    run, last, skip = 0, -1, False
    for bit in stuffed_bits(frame):
        if skip:
            assert bit != last
            run, last, skip = 1, bit, False
            continue
        plain.append(bit)
        run, last = (run + 1 if bit == last else 1), bit
        skip = run == 5
    remainder = 0
    for bit in plain:
        remainder = (remainder << 1 | bit) ^ (0xC599 if remainder >> 14 & 1 else 0)
        remainder &= 0x7FFF
    # Long division by x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 of message and CRC together leaves nothing.
    assert remainder == 0


@given(frames())
def test_never_longer_than_the_worst_case(frame: Frame) -> None:
    carried = 0 if frame.is_remote else len(frame.data)
    assert frame_length_bits(frame) <= worst_case_length_bits(carried, is_extended=frame.is_extended)


def test_the_worst_case_is_what_the_literature_says() -> None:
    assert worst_case_length_bits(8, is_extended=True) == 160
    assert worst_case_length_bits(8, is_extended=False) == 135
    assert all(b - a == 10 for a, b in pairwise(worst_case_length_bits(n, is_extended=True) for n in range(9)))
    with pytest.raises(ValueError, match="9 data bytes"):
        worst_case_length_bits(9, is_extended=True)


def test_a_remote_frame_has_no_data_field_whatever_its_dlc() -> None:
    lengths = [frame_length_bits(Frame(0x123, b"", False, True, remote_dlc=dlc)) for dlc in range(9)]
    assert max(lengths) - min(lengths) <= 4

"""The socketcand protocol in bytes: cut anywhere, written by whom it may."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.core.frame import Frame
from onboard.io.socketcand_protocol import Splitter, format_frame, format_send, parse_frame, parse_send

FRAMES = st.one_of(
    st.tuples(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8)).map(lambda one: Frame(*one)),
    st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)).map(lambda one: Frame(*one, is_extended=False)),
)


def words(message: str) -> list[str]:
    return message.split(" ")[1:]


@given(st.lists(FRAMES, max_size=8), st.data())
def test_a_stream_cut_anywhere_gives_the_same_frames(sent: list[Frame], data: st.DataObject) -> None:
    stream = b"".join(format_send(frame) for frame in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    splitter = Splitter()
    messages = []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        messages += splitter.feed(stream[begin:end])
    assert [parse_send(words(message)) for message in messages] == sent
    assert splitter.garbage == 0


@given(FRAMES, st.integers(0, 1 << 52))
def test_reports_carry_the_frame(frame: Frame, stamp_us: int) -> None:
    (message,) = Splitter().feed(format_frame(frame, stamp_us))
    assert parse_frame(words(message)) == frame


def test_reports_as_the_protocol_shows_them() -> None:
    assert (
        format_frame(Frame(0x123, bytes.fromhex("1A220344"), False), 23_424_242) == b"< frame 123 23.424242 1A220344 >"
    )
    assert format_frame(Frame(0x123, b"", False), 1) == b"< frame 123 0.000001  >"
    assert format_send(Frame(0x1AAAAAAA, b"\x01\xf1")) == b"< send 1AAAAAAA 2 1 f1 >"


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("123 0", Frame(0x123, b"", False)),
        ("00000123 1 7", Frame(0x123, b"\x07")),
        # SavvyCAN: bit 31 set for extended identifiers, identifier and bytes sign-extended by Qt.
        ("ffffffff98ff0201 2 8 ffffffffffffffc3", Frame(0x18FF0201, b"\x08\xc3")),
        ("98ff0201 2 8 ffffffc3", Frame(0x18FF0201, b"\x08\xc3")),
        ("80000123 1 ff", Frame(0x123, b"\xff")),
        ("7ff 1 7f", Frame(0x7FF, b"\x7f", False)),
        # python-can's client writes a remote frame as a length without bytes.
        ("100 2", Frame(0x100, b"", False, is_remote=True, remote_dlc=2)),
    ],
)
def test_requests_of_other_clients(text: str, frame: Frame) -> None:
    assert parse_send(text.split(" ")) == frame


@pytest.mark.parametrize(
    "text", ["", "123", "xyz 0", "123 9", "123 1 1 2", "123 2 1", "123 1 1ff", "123 1 -1", "40000123 0"]
)
def test_requests_that_are_no_frame(text: str) -> None:
    with pytest.raises(ValueError, match=r"send needs|identifier|length|byte"):
        parse_send(text.split())


def test_garbage_is_counted_and_passed_over() -> None:
    splitter = Splitter()
    assert splitter.feed(b"hello>< a >xx< b ><< c >") == ["a", "b", "c"]
    assert splitter.garbage == 3
    assert splitter.feed(b"<" + b"x" * 1000) == []
    assert splitter.garbage == 4
    assert splitter.feed(b"< d >") == ["d"]


@given(st.lists(st.binary(max_size=40)))
def test_no_stream_raises(pieces: list[bytes]) -> None:
    splitter = Splitter()
    for piece in pieces:
        for message in splitter.feed(piece):
            for parse in (parse_send, parse_frame):
                try:
                    parse(message.split(" "))
                except ValueError:
                    continue

"""Logs by columns: the same frames, the same faults and the same values as frame by frame."""

import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc import systems
from onboard.contract.base import FrameCode, Message
from onboard.contract.codes import Reason
from onboard.contract.messages import Reference, Stamp
from onboard.contract.packing import calls, device, plans, presence, rights, seal
from onboard.systems.registry import part
from onboard.trace.columns.block import FrameBlock, block_of, joined
from onboard.trace.columns.candump_text import read_block
from onboard.trace.columns.reading import blocks_of
from onboard.trace.columns.signals import SignalDecoder
from onboard.trace.dump.formats import log_line
from onboard.trace.raw import RawFrame
from onboard.trace.readers import open_log
from onboard.trace.readers.candump import read_candump
from onboard.trace.readers.faults import LogFaults
from onboard.trace.readers.open_log import Log
from tests.trace.runs import run_log

GOLDEN = Path(__file__).parents[1] / "golden"
SHARED = (*presence.FRAMES, *rights.FRAMES, *calls.FRAMES, *plans.FRAMES, *seal.FRAMES, *device.FRAMES)
#: Lines of which some are frames and some are not: what the reader of many lines must leave to the reader of one.
ODD_LINES = (
    *("", "   ", "\r", "hello", "#", "####", "(5.2) a 123#01", "(1.000000) can0 123##101 T", "(1.000000) can0 123#R"),
    *("(1.000000) can0 123#R3", "(0000000001.000000) can0 20000004#0000000000000000", "(1.000000) can0 1234#01"),
    *("(0000000001.000000) can0 123#012", "(0000000001.000000) can0 800#", "(0000000001.000000)  can0 123#01"),
    *("(0000000001.000000) can0  123#01", "(0000000001.000000) a\tb 123#01", "(0000000001.000000)  123#01"),
    *("(0000000001.000000123) can0 123#01", "(0000000001.000000) can0 123#01_9", "(0000000001.000000) can0 1#"),
    *("(0000000001.000000) can0 3FFFFFFF#", "(0000000001.000000) can0 123#01.02", "(000000000a.000000) can0 123#01"),
    *("(0000000001.000000) can0 12G#01", "(0000000001.000000) 123#01", "(0000000001.000000) 18FF0201#01"),
    *("(0000000001.000000) a-name-longer-than-two-words 123#01", "(0000000001.000000) can0 123#01#02"),
    *("(0000000001.000000) can0 123# T", "(0000000001.000000) a\0 123#", "(0000000001.000000) a\0\0 123#"),
    *("(0000000001.000000) k\u00e4 123#00", "(0000000001.000000) can0 123#0102030405060708 R\r"),
    *("(0000000001.000000) a#b 123#", "(0000000001.000000) can0 123#0102  R"),
)  # fmt: skip


def _slowly(text: bytes) -> tuple[list[tuple[int, RawFrame]], LogFaults]:
    faults = LogFaults()
    placed = list(read_candump(text.splitlines(keepends=True) if b"\r" not in text else _lines(text), faults))
    list(faults.watch(placed))
    return placed, faults


def _lines(text: bytes) -> list[bytes]:
    return [line + b"\n" for line in text.split(b"\n")[:-1]]


def _same(text: bytes) -> FrameBlock:
    placed, expected = _slowly(text)
    faults = LogFaults()
    block = read_block(text, 1, faults)
    assert list(zip(block.where.tolist(), block.frames(), strict=True)) == placed
    assert (faults.counts, faults.first, faults.frames) == (expected.counts, expected.first, expected.frames)
    assert faults.latest_us == expected.latest_us
    return block


@given(
    st.lists(
        st.one_of(
            st.sampled_from(ODD_LINES),
            st.builds(
                lambda frame, mark: log_line(frame) + mark,
                st.builds(
                    RawFrame,
                    st.integers(0, 10**16 - 1),
                    st.sampled_from(["fleet", "MR1", "c", "sixteen-letters-", "seventeen-letters"]),
                    st.integers(0, 0x7FF),
                    st.binary(max_size=8),
                )
                | st.builds(
                    RawFrame,
                    st.integers(0, 10**13),
                    st.just("fleet"),
                    st.integers(0, 0x1FFFFFFF),
                    st.binary(max_size=8),
                    st.just(True),
                ),
                st.sampled_from(["", "", " R", " T"]),
            ),
            st.text("(0123456789.) ABCDEFabcdef#RT_\t", max_size=50),
        ),
        min_size=1,
        max_size=12,
    )
)
def test_many_lines_at_once_are_read_as_line_by_line(lines: list[str]) -> None:
    _same("".join(f"{line}\n" for line in lines).encode())


def test_every_odd_line_alone_and_between_others_is_read_the_same() -> None:
    plain = "(0000000002.000000) fleet 18FF0201#08C3"
    for line in ODD_LINES:
        _same(f"{line}\n".encode())
        _same(f"{plain}\n{line}\n{plain}\n".encode())
    _same("".join(f"{line}\n" for line in ODD_LINES).encode())


@pytest.mark.parametrize("name", ["L.txt", "Lx.txt", "anyL.txt"])
def test_candumps_own_logs_are_read_the_same(name: str) -> None:
    _same((GOLDEN / name).read_bytes())


def test_a_whole_log_is_read_the_same_in_pieces_of_any_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = run_log().read_bytes()[:-20]
    log_file = tmp_path / "run.log"
    log_file.write_bytes(text)
    with Log(str(log_file)) as log:
        expected, faults = list(log.one_by_one()), log.faults.lines()
    assert [fault.partition(":")[0] for fault in faults] == ["cut off at the end"]
    for piece, least in ((1 << 21, 1), (997, 1), (61, 1), (5_000, 1 << 14)):
        monkeypatch.setattr(open_log, "_PIECE_BYTES", piece)
        monkeypatch.setattr(open_log, "_LEAST_BYTES", least)
        with Log(str(log_file)) as log:
            assert (list(log), log.faults.lines()) == (expected, faults)
        with Log(str(log_file)) as log:
            whole = joined(list(blocks_of(log)))
            assert (list(whole.frames()), log.faults.lines()) == (expected, faults)


def test_frames_of_other_formats_go_into_the_same_columns() -> None:
    frames = [
        RawFrame(5, "a", 0x123, b"\x01", sent=True),
        RawFrame(6, "b", 0x18FF0201, bytes(8), True, sent=False),
        RawFrame(7, "a", 0x100, b"", is_remote=True, remote_dlc=3),
        RawFrame(8, "a", 0x100, bytes(64), fd_flags=1),
        RawFrame(9, "a", 0x80, bytes(8), is_error=True),
    ]
    block = block_of(list(enumerate(frames, 1)))
    assert list(block.frames()) == frames
    assert block.is_data.tolist() == [True, True, False, False, False]


def _codes() -> list[tuple[str, FrameCode]]:
    own = [(name, code) for name in systems() for code in part(name, "frames").FRAMES]  # type: ignore[union-attr]  # all have
    return [*(("", code) for code in SHARED), *own]


def _flat(message: Message) -> dict[str, int]:
    """A message's fields by the names of their signals."""
    found: dict[str, int] = {}
    for name in type(message).__match_args__:
        value = getattr(message, name)
        if isinstance(value, Reference | Stamp):
            found |= {f"{name}_{inner}": int(one) for inner, one in zip(value._fields, value, strict=True)}
        else:
            found[name] = int(value)
    return found


@pytest.mark.parametrize(("system", "code"), _codes(), ids=lambda one: getattr(one, "name", one))
def test_every_signal_of_random_frames_is_the_codecs(system: str, code: FrameCode) -> None:
    chance = random.Random(code.name)
    frames, reasons = [], []
    for number in range(400):
        size = code.length if number % 10 else chance.randrange(9)
        data = chance.randbytes(size)
        if number % 3 == 0 and size == code.length:
            message = next((one for _ in range(300) if (one := code.unpack(7, chance.randbytes(size)))), None)
            data = code.pack(message) if message is not None else data
        frames.append(RawFrame(number, "fleet", code.identifier | chance.choice((1, 7, 255)), data, True))
    decoder = SignalDecoder(system)
    (found,) = decoder.decode(block_of(list(enumerate(frames))))
    expected = []
    for frame in frames:
        whole = len(frame.data) >= code.length
        message = code.unpack(frame.can_id & 0xFF, frame.data) if whole else None
        if message is None:
            reasons.append(Reason.VALUE_OUT_OF_RANGE if whole else Reason.SHORT_FRAME)
        else:
            expected.append((frame.time_us, _flat(message)))
    columns = {"sender": found.sender} | {signal.name: found.values[signal.name] for signal in found.layout.signals}
    lists = zip(*(column.tolist() for column in columns.values()), strict=True)
    rows = [
        (row, dict(zip(columns, values, strict=True))) for row, values in zip(found.rows.tolist(), lists, strict=True)
    ]
    assert rows == expected
    assert all(decoder.drops[reason] == reasons.count(reason) for reason in set(reasons) | set(decoder.drops))
    assert all(np.iinfo(column.dtype).bits <= 64 for column in found.values.values())


def test_frames_of_no_contract_are_counted() -> None:
    frames = [
        RawFrame(1, "fleet", 0x18FF0201, bytes(8), True),
        RawFrame(2, "fleet", 0x123, bytes(8)),
        RawFrame(3, "fleet", presence.FRAMES[0].identifier, bytes(8), True),
        RawFrame(4, "fleet", presence.FRAMES[0].identifier & 0x7FF, bytes(8)),
    ]
    decoder = SignalDecoder()
    assert list(decoder.decode(block_of(list(enumerate(frames))))) == []
    assert decoder.drops == {Reason.UNKNOWN_IDENTIFIER: 4}

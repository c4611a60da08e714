"""Logs of other people's tools: BLF and TRC in, ASC out and in again, with the names of the buses."""

import io
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.trace.cli import main
from onboard.trace.dump.formats import log_line
from onboard.trace.raw import RawFrame
from onboard.trace.readers.asc import read_asc
from onboard.trace.readers.asc_writer import AscWriter
from onboard.trace.readers.faults import LogFaults
from onboard.trace.readers.open_log import Log
from tests.tools import require_tool, run_tool

START_S = 1_795_230_340.25
MESSAGES = (
    can.Message(START_S, 0x123, is_extended_id=False, channel=0, data=b"\x01\x02", is_rx=True),
    can.Message(START_S + 1.000003, 0x18FF0201, is_extended_id=True, channel=1, data=bytes(8), is_rx=False),
    can.Message(START_S + 1.000103, 0x100, is_extended_id=False, is_remote_frame=True, channel=1, dlc=3),
    can.Message(
        START_S + 1.000203, 0x100, is_extended_id=False, is_fd=True, bitrate_switch=True, channel=1, data=bytes(12)
    ),
    can.Message(START_S + 1.000303, is_error_frame=True, channel=1),
)
#: As candump -L -x has them; python-can says of every remote, FD and error frame that it was received.
LINES = [
    "(1795230340.250000) can1 123#0102 R",
    "(1795230341.250003) can2 18FF0201#0000000000000000 T",
    "(1795230341.250103) can2 100#R3 R",
    "(1795230341.250203) can2 100##5000000000000000000000000 R",
    "(1795230341.250303) can2 20000080#0000000000000000 R",
]


def _written(path: Path, *messages: can.Message) -> Path:
    with can.Logger(path) as log:
        for message in messages:
            log.on_message_received(message)
    return path


def _read(path: Path) -> tuple[list[str], list[str]]:
    with Log(str(path)) as log:
        return [log_line(frame, extra=True) for frame in log], log.faults.lines()


def test_a_blf_gives_every_frame_of_it(tmp_path: Path) -> None:
    assert _read(_written(tmp_path / "some.blf", *MESSAGES)) == (LINES, [])


def test_a_trc_gives_the_data_frames_that_it_can_hold(tmp_path: Path) -> None:
    assert _read(_written(tmp_path / "some.trc", *MESSAGES[:2])) == (LINES[:2], [])


@pytest.mark.parametrize("name", ["some.blf", "some.trc"])
def test_damage_ends_the_reading_and_is_told(name: str, tmp_path: Path) -> None:
    messages = [
        can.Message(START_S + number, 0x123, channel=0, data=bytes(8), is_extended_id=False) for number in range(9)
    ]
    path = _written(tmp_path / name, *messages)
    data = path.read_bytes()
    path.write_bytes(data[:-30] if name.endswith("blf") else data + b"  10  nonsense DT x y Rx - 8 00\n")
    lines, faults = _read(path)
    assert 0 < len(lines) <= 9 and all(line.endswith("123#0000000000000000 R") for line in lines)
    assert [fault.partition(":")[0] for fault in faults] == ["cut off at the end"]


TIMES = st.integers(0, 10**15)
FRAMES = st.one_of(
    st.builds(
        lambda time_us, channel, can_id, data: RawFrame(time_us, channel, can_id, data, sent=False),
        TIMES,
        st.sampled_from(["can0", "can1", "fleet", "MR1"]),
        st.integers(0, 0x7FF),
        st.binary(max_size=8),
    ),
    st.builds(
        lambda time_us, can_id, data: RawFrame(time_us, "can0", can_id, data, True),
        TIMES,
        st.integers(0, 0x1FFFFFFF),
        st.binary(max_size=8),
    ),
    st.builds(
        lambda time_us, size: RawFrame(time_us, "can7", 0x100, b"", is_remote=True, remote_dlc=size),
        TIMES,
        st.integers(0, 8),
    ),
    st.builds(
        lambda time_us, size, flags: RawFrame(time_us, "fd0", 0x18FF0201, bytes(size), True, fd_flags=4 | flags),
        TIMES,
        st.sampled_from([0, 1, 8, 12, 16, 20, 24, 32, 48, 64]),
        st.integers(0, 3),
    ),
    st.builds(lambda time_us: RawFrame(time_us, "can0", 0x80, bytes(8), is_error=True), TIMES),
)


@given(st.lists(FRAMES, min_size=1, max_size=8))
def test_what_goes_out_as_asc_comes_in_again_with_the_names_of_its_buses(frames: list[RawFrame]) -> None:
    frames.sort(key=lambda frame: frame.time_us)
    file, faults = io.StringIO(), LogFaults()
    writer = AscWriter(file)
    for frame in frames:
        writer.write(frame)
    writer.close()
    again = [frame for _, frame in read_asc(io.BytesIO(file.getvalue().encode()), faults)]
    assert [log_line(frame) for frame in again] == [log_line(frame) for frame in frames]
    assert faults.lines() == []


def test_python_can_reads_our_asc(tmp_path: Path) -> None:
    source, out = tmp_path / "in.log", tmp_path / "out.asc"
    source.write_text("".join(f"{line}\n" for line in LINES))
    assert main(["convert", str(source), str(out)]) == 0
    with can.ASCReader(out, relative_timestamp=False) as reader:
        found = list(reader)
    assert [(one.channel, one.arbitration_id, bytes(one.data)) for one in found] == [
        (one.channel, one.arbitration_id, bytes(one.data)) for one in MESSAGES
    ]
    assert [one.is_rx for one in found[:2]] == [True, False]


def test_can_utils_read_our_asc(tmp_path: Path) -> None:
    require_tool("asc2log")
    source, out = tmp_path / "in.log", tmp_path / "out.asc"
    source.write_text("(0000000005.250000) can0 123#0102\n(0000000006.250003) can0 18FF0201#0000000000000000\n")
    assert main(["convert", str(source), str(out)]) == 0
    told = run_tool("asc2log", "-I", str(out)).splitlines()
    assert [line.split()[2] for line in told] == ["123#0102", "18FF0201#0000000000000000"]


def test_a_bus_that_another_tool_counts_from_0_stays_can0(tmp_path: Path) -> None:
    source, out = tmp_path / "in.asc", tmp_path / "out.asc"
    source.write_text(
        "date Wed Nov 8 21:17:01 2023\nbase hex  timestamps absolute\n   0.083540 0  594\tRx   d 2 34 21\n"
    )
    assert main(["convert", str(source), str(out)]) == 0
    assert _read(source)[0] == _read(out)[0] == ["(1699478221.083540) can0 594#3421 R"]

"""The log in candump's format: as can-utils writes and reads it, and read back whole whatever happened to it."""

import io
from pathlib import Path

import can
from hypothesis import given
from hypothesis import strategies as st

from onboard.core.frame import Frame
from onboard.trace.candump import CandumpWriter, format_line
from onboard.trace.candump_reader import CandumpReader, LineFault, LogRecord, parse_line
from tests.tools import require_tool, run_tool

GOLDEN = Path(__file__).parent.parent / "golden"


def golden_lines(name: str) -> list[bytes]:
    return (GOLDEN / name).read_bytes().splitlines(keepends=True)


def frames() -> st.SearchStrategy[Frame]:
    short, long, data = st.integers(0, 0x7FF), st.integers(0, 0x1FFFFFFF), st.binary(max_size=8)
    return st.one_of(
        st.tuples(long, data).map(lambda one: Frame(*one)),
        st.tuples(short, data).map(lambda one: Frame(*one, is_extended=False)),
        st.tuples(short, st.integers(0, 8)).map(
            lambda one: Frame(one[0], is_extended=False, is_remote=True, remote_dlc=one[1])
        ),
        st.tuples(long, st.binary(min_size=8, max_size=8)).map(lambda one: Frame(*one, is_error=True)),
    )


def test_writes_what_candump_wrote() -> None:
    """Every classic line of a real capture is written again as it was."""
    classic = [line for line in golden_lines("L.txt") + golden_lines("cangen.txt") if b"##" not in line]
    reader = CandumpReader(classic)
    again = [format_line(*record).encode() + b"\n" for record in reader]
    assert again == classic
    assert not reader.faults
    assert len(again) == 13


def test_flexible_frames_are_counted_not_guessed() -> None:
    reader = CandumpReader(golden_lines("L.txt"))
    assert len(list(reader)) == 8
    assert reader.faults == {LineFault.FD: 2}
    assert reader.first == {LineFault.FD: 6}


def test_suffixes_and_line_ends_make_no_difference() -> None:
    plain = [parse_line(line) for line in golden_lines("Lx.txt")]
    assert plain == [parse_line(line.replace(b" T", b"")) for line in golden_lines("Lx.txt")]
    assert plain == [parse_line(line.replace(b"\n", b" \r\n")) for line in golden_lines("Lx.txt")]
    assert sum(isinstance(one, LogRecord) for one in plain) == 7


def test_kinds_of_frames_in_the_capture() -> None:
    found = {record.frame for record in CandumpReader(golden_lines("L.txt"))}
    assert Frame(0x100, b"", False, is_remote=True, remote_dlc=2) in found
    assert Frame(0x100, b"\x01\x02", True) in found
    assert Frame(4, bytes.fromhex("000C000000000000"), is_error=True) in found
    assert Frame(0x123, b"", False) in found


@given(st.lists(st.tuples(st.integers(0, 4_000_000_000_000_000), st.sampled_from(["vcan0", "fleet", "MR1"]), frames())))
def test_what_is_written_is_read(records: list[tuple[int, str, Frame]]) -> None:
    file = io.BytesIO()
    file.close = lambda: None  # type: ignore[method-assign]  # the content is looked at after the writer has closed it
    with CandumpWriter(file) as writer:
        for record in records:
            writer.write(*record)
    reader = CandumpReader(file.getvalue().splitlines(keepends=True))
    assert list(reader) == records
    assert not reader.faults
    assert writer.frames == len(records)


@given(st.binary())
def test_no_line_raises(line: bytes) -> None:
    assert isinstance(parse_line(line), LogRecord | LineFault)


def test_faults_by_reason() -> None:
    lines = [
        b"(1.000000) can0 123#00\n",
        b"  vcan0  18FF0201   [8]  08 C3 00 01 7E 0B 00 00\n",
        b"\n",
        b"(1.000000) can0 800#00\n",
        b"(1.000000) can0 40000000#00\n",
        b"(1.000000) can0 1234#00\n",
        b"(1.000000) can0 123#000\n",
        b"(1.000000) can0 123#001122334455667788\n",
        b"(1.000000) can0 123#R9\n",
        b"(1.0) can0 123#00\n",
        b"\xff\xfe\n",
        b"(2.000000) can0 123#01\n",
        b"(3.000000) can0 123#0102",
    ]
    reader = CandumpReader(lines)
    assert [record.time_us for record in reader] == [1_000_000, 2_000_000]
    assert reader.faults == {LineFault.NOT_A_LINE: 3, LineFault.IDENTIFIER: 3, LineFault.DATA: 3, LineFault.CUT: 1}
    assert reader.first[LineFault.CUT] == 13


def test_a_log_of_nanoseconds_is_cut_to_microseconds() -> None:
    found = parse_line(b"(12.345678901) can0 123#00")
    assert isinstance(found, LogRecord)
    assert found.time_us == 12_345_678


def test_a_log_is_readable_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "trace.log"
    with CandumpWriter(path) as writer:
        writer.write(1_000_001, "fleet", Frame(0x18FF0201, b"\x08"))
        writer.flush()
        assert path.read_bytes() == b"(0000000001.000001) fleet 18FF0201#08\n"


def test_log2asc_reads_our_log(tmp_path: Path) -> None:
    """can-utils understands every kind of frame that we write as what it is."""
    tool = require_tool("log2asc")
    path = tmp_path / "trace.log"
    with CandumpWriter(path) as writer:
        writer.write(1_795_230_340_000_000, "vcan0", Frame(0x18FF0201, bytes.fromhex("08C3")))
        writer.write(1_795_230_340_250_000, "vcan0", Frame(0x100, b"\x01", False))
        writer.write(1_795_230_340_500_000, "vcan0", Frame(0x100, b"", False, is_remote=True, remote_dlc=2))
        writer.write(1_795_230_340_750_001, "vcan0", Frame(4, bytes(8), is_error=True))
    lines = run_tool(tool, "-I", str(path), "vcan0").splitlines()
    shown = [" ".join(line.split()) for line in lines if line.strip()[:1].isdigit()]
    assert shown == [
        "0.000000 1 18FF0201x Rx d 2 08 C3",
        "0.250000 1 100 Rx d 1 01",
        "0.500000 1 100 Rx r 2",
        "0.750001 1 ErrorFrame",
    ]


def test_python_can_reads_our_log_and_we_read_its(tmp_path: Path) -> None:
    """Both ways between this format and the library that most people use; it appends a direction."""
    ours, theirs = tmp_path / "ours.log", tmp_path / "theirs.log"
    written = [
        (1_795_230_340_000_000, "can0", Frame(0x18FF0201, bytes.fromhex("08C3"))),
        (1_795_230_340_250_000, "can0", Frame(0x7FF, b"", False)),
        # Its remote frames lose the length asked for on the way.
        (1_795_230_340_500_000, "can0", Frame(0x100, b"", False, is_remote=True)),
    ]
    with CandumpWriter(ours) as writer:
        for record in written:
            writer.write(*record)
    with can.CanutilsLogReader(ours) as messages, can.CanutilsLogWriter(theirs) as log:
        for message in messages:
            log.on_message_received(message)
    assert theirs.read_bytes().count(b" R\n") == 3
    with theirs.open("rb") as lines:
        assert [(one.time_us, one.frame) for one in CandumpReader(lines)] == [(one[0], one[2]) for one in written]

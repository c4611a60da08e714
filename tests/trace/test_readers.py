"""Logs of other tools, and damaged ones: everything in them is read, reported or counted."""

import io
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.trace.cli import main
from onboard.trace.dump.formats import log_line
from onboard.trace.raw import RawFrame
from onboard.trace.readers.open_log import Log
from onboard.trace.readers.pcapng_writer import PcapngWriter
from tests.tools import DEADLINE_S, require_tool, run_tool

GOLDEN = Path(__file__).parents[1] / "golden"


def _read(path: Path) -> tuple[list[str], list[str]]:
    with Log(str(path)) as log:
        lines = [log_line(frame) for frame in log]
    return lines, log.faults.lines()


def test_pcapng_gives_every_frame_back(tmp_path: Path) -> None:
    source, copy = GOLDEN / "L.txt", tmp_path / "copy.pcapng"
    assert main(["convert", str(source), str(copy)]) == 0
    assert _read(copy)[0] == source.read_text().splitlines()


def test_tshark_reads_our_pcapng_with_one_named_interface_for_each_bus(tmp_path: Path) -> None:
    require_tool("tshark")
    out = tmp_path / "two.pcapng"
    assert main(["convert", str(GOLDEN / "anyL.txt"), str(out)]) == 0
    told = run_tool("tshark", "-r", str(out), "-T", "fields", "-e", "frame.interface_name", "-e", "can.id")
    seen = [(line.split("\t")[0], int(line.split("\t")[1], 0)) for line in told.splitlines()]
    assert seen == [
        *(("vcan0", can_id) for can_id in (0x18FF0201, 0x100, 0x100, 0x100, 0x123, 0x18FFAA01, 0x123, 0x100)),
        ("vcan0", 0x18FF0203),
        ("vcan1", 0x7FF),
    ]


def test_a_pcapng_of_the_other_byte_order_and_resolution_is_read(tmp_path: Path) -> None:
    path = tmp_path / "big.pcapng"

    def block(kind: int, body: bytes) -> bytes:
        size = (len(body) + 12).to_bytes(4, "big")
        return kind.to_bytes(4, "big") + size + body + size

    name, nanoseconds = b"\x00\x02\x00\x04can7", b"\x00\x09\x00\x01\x09\x00\x00\x00"
    packet = bytes.fromhex("80000123020000000102")
    head = (0).to_bytes(4, "big") + (1_500_000_000_123_456_789).to_bytes(8, "big") + len(packet).to_bytes(4, "big") * 2
    path.write_bytes(
        block(0x0A0D0D0A, bytes.fromhex("1A2B3C4D00010000") + b"\xff" * 8)
        + block(1, b"\x00\xe3\x00\x00" + bytes(4) + name + nanoseconds)
        + block(6, head + packet + bytes(2))
    )
    assert _read(path) == (["(1500000000.123456) can7 00000123#0102"], [])


def test_a_pcapng_cut_short_gives_what_is_whole(tmp_path: Path) -> None:
    file = io.BytesIO()
    writer = PcapngWriter(file)
    for number in range(3):
        writer.write(RawFrame(number, "fleet", 0x10 + number, b"\x01"))
    path = tmp_path / "cut.pcapng"
    path.write_bytes(file.getvalue()[:-5])
    lines, faults = _read(path)
    assert [line.split()[-1] for line in lines] == ["010#01", "011#01"]
    assert faults == ["cut off at the end: 1 time, first at 5"]


@pytest.mark.parametrize("options", [[], ["-f"]])
def test_logs_of_log2asc_are_read(options: list[str], tmp_path: Path) -> None:
    require_tool("log2asc")
    path = tmp_path / "golden.asc"
    asc = run_tool("log2asc", *options, "-I", str(GOLDEN / "Lx.txt"), "vcan0")
    path.write_text("date Sat Nov 21 03:05:40 2026\n" + asc.partition("\n")[2])
    lines, faults = _read(path)
    expected = [line.split()[2] for line in (GOLDEN / "Lx.txt").read_text().splitlines()]
    # ASC tells of CAN FD, of BRS and of ESI; the mark that this is CAN FD is the kernel's.
    assert [line.split()[2].replace("##4", "##0").replace("##5", "##1") for line in lines] == [
        word.replace("##4", "##0").replace("##5", "##1") for word in expected
    ]
    assert (lines[0].split()[0], faults) == ("(1795230340.000000)", [])


def test_every_kind_of_line_of_an_asc_log(tmp_path: Path) -> None:
    path = tmp_path / "kinds.asc"
    path.write_text(
        "date Wed, 08 Nov 2023 21:17:01 GMT\nbase hex  timestamps relative\nbegin triggerblock\n"
        "   0.500000 1  594\tRx   d 2 34 21  Length = 240000 BitCount = 124 ID = 1428\n"
        "   0.250000 2  18FF0201x  Tx   r\n"
        "   0.000001 2  ErrorFrame\n"
        "   0.000001 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n"
        "   0.000001 1  594 Rx d 8 34 21\n"
        "   0.000001 1  FFFF Rx d 0\n"
        "   nonsense\n"
        "end triggerblock\n"
    )
    lines, faults = _read(path)
    assert lines == [
        "(1699478221.500000) can1 594#3421",
        "(1699478221.750000) can2 18FF0201#R",
        "(1699478221.750001) can2 20000080#0000000000000000",
    ]
    assert faults == [
        "data that are not whole bytes, or more than a frame holds: 1 time, first at 8",
        "identifier out of range: 1 time, first at 9",
        "not a frame of this format: 1 time, first at 10",
    ]


def test_python_cans_suffixes_are_read_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "suffix.log"
    path.write_text("(1.000000) can0 123#01 R\n(1.000001) can0 123##101 T\n")
    with Log(str(path)) as log:
        assert [(frame.sent, frame.fd_flags) for frame in log] == [(False, None), (True, 1)]


def test_what_is_wrong_with_a_log_is_counted_and_the_rest_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bad.log"
    path.write_text(
        "(5.000000) a 123#01\n(2.000000) b 123#02\n(5.100000) a 123#03\n(5.000000) a 123#04\n"
        "\nhello\n(5.2) a 123#01\n(5.300000) a 1234#01\n(5.400000) a 123#012\n(5.500000) a 800#\n(6.000000) a 123#0"
    )
    lines, faults = _read(path)
    assert [line[-2:] for line in lines] == ["01", "02", "03", "04"]
    assert faults == [
        "cut off at the end: 1 time, first at 11",
        "data that are not whole bytes, or more than a frame holds: 1 time, first at 9",
        "identifier out of range: 2 times, first at 8",
        "not a frame of this format: 2 times, first at 6",
        "time running backwards: 1 time, first at 4",
    ]


@pytest.mark.parametrize(
    ("text", "guess"),
    [
        (b"\x7fELF\x02\x01\n\0\0", "it looks like a program; name a log"),
        (b"timestamp,arbitration_id\n1,2\n", "it looks like python-can's CSV; write it anew as ASC"),
        (b"\xd4\xc3\xb2\xa1\x02\0\x04\0", "it looks like a pcap capture; write it anew as pcapng: editcap"),
        (b"\x1f\x8b\x08\0\n", "it looks like packed by gzip; unpack it first"),
        (b"  can0  123   [2]  11 22\n", "it looks like what candump shows on a screen; record with candump -L"),
        (b"[site]\nname = 'a'\n", "it looks like TOML, perhaps a site file"),
        (b"\xff\0\xfe", "it is binary, of no format that we know"),
        (b"hello", 'it is text that begins with "hello"'),
        (b"", "is empty; name a log that something was written to"),
    ],
)
@pytest.mark.parametrize("command", [["dump"], ["check", "--site", "small"], ["calls", "--site", "small"]])
def test_a_file_that_is_no_log_is_status_2_and_a_guess_at_what_it_is(
    text: bytes, guess: str, command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "any.bin"
    file.write_bytes(text)
    assert main([command[0], str(file), *command[1:]]) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and guess in told.err and str(file) in told.err, told.err
    assert told.out == ""


def test_a_log_with_one_frame_among_other_text_is_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "any.log"
    file.write_bytes(b"hello\n(1.000000) can0 123#11\n")
    assert main(["dump", str(file)]) == 0
    assert "not a frame of this format: 1 time, first at 1" in capsys.readouterr().err


def test_a_pipe_is_read_as_it_comes(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"(1.000000) can0 123#01\n(1.000000) can0 123#0")))
    assert main(["dump", "-", "-L"]) == 0
    told = capsys.readouterr()
    assert told.out == "(0000000001.000000) can0 123#01\n"
    assert told.err == "-: cut off at the end: 1 time, first at 2\n"


def test_a_closed_pipe_ends_the_dump_quietly(tmp_path: Path) -> None:
    path = tmp_path / "long.log"
    path.write_text("(1.000000) can0 123#01\n" * 20_000)
    command = [sys.executable, "-m", "onboard", "trace", "dump", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(timeout=DEADLINE_S) == 1


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_long_log_is_read_in_bounded_memory(tmp_path: Path) -> None:
    import tracemalloc

    def peak(frames: int) -> int:
        path = tmp_path / "long.log"
        path.write_text("(1.000000) can0 18FF0201#0102030405060708\n" * frames)
        tracemalloc.start()
        with Log(str(path)) as log:
            assert sum(1 for _ in log) == frames
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    # The first log is longer than what is read at once; numpy comes with it.
    first, second, longer = peak(20_000), peak(20_000), peak(60_000)
    assert first < 20_000_000
    assert longer - second < 500_000


def test_a_terminal_sees_a_bar_that_is_wiped_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "some.log"
    path.write_text("(1.000000) can0 18FF0201#0102030405060708\n" * 100)
    monkeypatch.setattr("onboard.trace.readers.open_log._BAR_PERIOD_S", 0.0)
    monkeypatch.setattr("onboard.trace.readers.open_log._PIECE_BYTES", 43)
    bar = _Terminal()
    with Log(str(path), bar=bar) as log:
        assert sum(1 for _ in log) == 100
    shown = bar.getvalue()
    assert " 50%" in shown and "100%" in shown and shown.endswith("\r\x1b[K")

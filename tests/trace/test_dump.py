"""``onboard trace dump``: byte for byte what the real candump printed of one capture; log2long tells of others."""

import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from onboard.core.frame import Frame
from onboard.trace.cli import main
from onboard.trace.dump.error_frames import describe
from onboard.trace.dump.formats import log_line
from onboard.trace.raw import RawFrame
from tests.tools import require_tool, run_tool

GOLDEN = Path(__file__).parents[1] / "golden"
#: The file of the golden directory, the input, and the words that candump was given.
CASES = [
    ("L", "L", ["-L", "any,0:0,#FFFFFFFF"]),
    ("Lx", "Lx", ["-L", "-x"]),
    ("Lx", "L", ["-L", "-x"]),
    ("default", "L", []),
    ("ta", "L", ["-ta"]),
    ("tA", "L", ["-tA"]),
    ("td", "L", ["-td"]),
    ("tz", "L", ["-tz"]),
    ("x", "Lx", ["-x"]),
    ("x", "L", ["-x"]),
    ("ascii", "L", ["-a"]),
    ("S", "L", ["-S"]),
    ("e", "L", ["-e"]),
    ("e", "L", ["-e", "vcan0,0:0,#FFFFFFFF"]),
    ("color", "L", ["-c"]),
    ("color2", "L", ["-cc"]),
    ("filt", "L", ["-ta", "vcan0,18FF0200:1FFFFF00"]),
    ("two", "anyL", ["-ta"]),
    ("anyL", "anyL", ["-L"]),
    ("cangen", "cangen", ["-L"]),
]

Dump = Callable[..., list[str]]


@pytest.fixture(autouse=True)
def _utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.fixture
def dump(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Dump:
    def run(log: str, *words: str) -> list[str]:
        path = tmp_path / "case.log"
        path.write_text(log)
        assert main(["dump", str(path), *words]) == 0
        return capsys.readouterr().out.splitlines()

    return run


@pytest.mark.parametrize(("golden", "source", "words"), CASES)
def test_the_real_candump_printed_the_same(
    golden: str, source: str, words: list[str], capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    assert main(["dump", str(GOLDEN / f"{source}.txt"), *words]) == 0
    assert capfdbinary.readouterr().out == (GOLDEN / f"{golden}.txt").read_bytes()


def test_every_golden_file_that_shows_frames_is_tried() -> None:
    assert {path.stem for path in GOLDEN.glob("*.txt")} - {golden for golden, _, _ in CASES} == {"canplayer-help"}


def test_log2long_prints_any_frames_the_same(tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    require_tool("log2long")
    chance = random.Random(6)
    lines = [log_line(_any_frame(chance, number)) for number in range(2_000)]
    path = tmp_path / "any.log"
    path.write_text("\n".join(lines) + "\n")
    assert main(["dump", str(path), "-a", "-ta", "can0,0:0,#FFFFFFFF"]) == 0
    mine = capfdbinary.readouterr().out.decode().splitlines()
    # log2long puts the time without candump's margin, and one space less before the interface.
    other = run_tool("log2long", stdin=path.read_bytes()).splitlines()
    assert [" ".join(line.split()) for line in mine] == [" ".join(line.split()) for line in other]


def _any_frame(chance: random.Random, number: int) -> RawFrame:
    extended, kind = chance.random() < 0.5, chance.randrange(8)
    can_id = chance.randrange(1 << 29 if extended else 1 << 11)
    data = chance.randbytes(chance.randrange(9))
    time_us = 1_700_000_000_000_000 + number
    if kind == 0:
        return RawFrame(time_us, "can0", can_id, b"", extended, is_remote=True, remote_dlc=len(data))
    if kind == 1:
        return RawFrame(time_us, "can0", chance.randrange(1, 1 << 9), data.ljust(8, b"\0"), is_error=True)
    if kind == 2:
        long = chance.randbytes(chance.choice([0, 3, 8, 12, 64]))
        return RawFrame(time_us, "can0", can_id, long, extended, fd_flags=chance.randrange(4))
    return RawFrame(time_us, "can0", can_id, data, extended)


FILTERED = """\
(1.000000) a 123#01
(1.000001) a 00000123#02
(1.000002) b 124#03
(1.000003) b 123#R1
(1.000004) a 20000004#000C000000000000
(1.000005) a 20000040#0000000000000000
"""


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["-L"], "01 02 03 R1"),
        (["-L", "123:7FF"], "01 02 R1"),
        (["-L", "123:C00007FF"], "01"),
        (["-L", "00000123:DFFFFFFF"], "02"),
        (["-L", "123~7FF"], "03"),
        (["-L", "a"], "01 02"),
        (["-L", "a,123:7FF", "b,124:7FF"], "01 02 03"),
        (["-L", "123:7FF,124:7FF,j"], ""),
        (["-L", "123:7FF,0:80000000,j"], "01 R1"),
        (["-L", "0~0,#00000040"], "0000000000000000"),
        (["-L", "0~0,#FFFFFFFF"], "000C000000000000 0000000000000000"),
        (["-L", "-n2"], "01 02"),
    ],
)
def test_filters_choose_as_the_kernel_does(dump: Dump, words: list[str], shown: str) -> None:
    assert " ".join(line.partition("#")[2] for line in dump(FILTERED, *words)) == shown


def test_error_frames_that_nobody_asked_for_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "case.log"
    path.write_text(FILTERED)
    assert main(["dump", str(path)]) == 0
    assert "error frames not shown: 2; -e shows them" in capsys.readouterr().err


def test_error_frames_in_words() -> None:
    def words(error_class: int, data: str) -> str:
        return describe(RawFrame(0, "can0", error_class, bytes.fromhex(data), is_error=True))

    assert words(0x2, "0500000000000000") == "lost-arbitration{at bit 5}"
    assert words(0x8, "0000040A00000000") == "protocol-violation{{bit-stuffing-error}{data-field}}"
    assert words(0x60, "0000000000008000") == "no-acknowledgement-on-tx,bus-off,error-counter-tx-rx{{128}{0}}"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["zz:7FF"], "filter 'zz:7FF' in 'zz:7FF': write ID:MASK, ID~MASK or #ERRORMASK in hexadecimal"),
        (["can0,12"], "filter '12' in 'can0,12'"),
    ],
)
def test_a_wrong_filter_is_one_clear_line(words: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dump", str(GOLDEN / "L.txt"), *words]) == 2
    said = capsys.readouterr().err
    assert line in said and said.count("\n") == 1


def test_a_log_that_is_not_there_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dump", "nowhere.log"]) == 2
    assert "nowhere.log: cannot be read" in capsys.readouterr().err


def test_l_writes_a_log_named_as_candump_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["dump", str(GOLDEN / "L.txt"), "-l", "-e"]) == 0
    assert (tmp_path / "candump-2026-11-21_030540.log").read_bytes() == (GOLDEN / "L.txt").read_bytes()
    assert not capsys.readouterr().out


def test_raw_frames_keep_what_controllers_frames_can_hold() -> None:
    frame = RawFrame(5, "can0", 0x123, b"\x01", is_extended=True)
    assert frame.classic() == Frame(0x123, b"\x01")
    assert frame._replace(fd_flags=4).classic() is None

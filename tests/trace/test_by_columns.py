"""What is shown and judged by columns: the same as frame by frame."""

import random
from pathlib import Path

import pytest
from cantools.database import load_string
from cantools.database.can.database import Database

from onboard.trace.check.checks import Checks
from onboard.trace.cli import main
from onboard.trace.dump.formats import log_line
from onboard.trace.raw import RawFrame
from onboard.trace.readers import open_log
from onboard.trace.readers.open_log import Log
from onboard.wire.dbc_file import AnyDbc
from onboard.wire.site_dbc import site_dbc
from tests.trace.runs import SITE, SITE_FILE, run_log

#: Signals of every form: either byte order, signs, factors, value tables, a float, and some that depend on another.
DBC = """\
VERSION ""
BS_:
BU_: A
BO_ 100 Plain: 8 A
 SG_ little : 3|13@1- (0.5,-7) [0|0] "mm/s" A
 SG_ big : 23|12@0- (2,1) [0|0] "" A
 SG_ named : 40|3@1+ (1,0) [0|0] "V" A
 SG_ last : 63|8@0+ (0.1,0) [0|0] "%" A
BO_ 101 Float: 8 A
 SG_ number : 0|32@1- (1,0) [0|0] "C" A
BO_ 102 Multiplexed: 8 A
 SG_ which M : 0|8@1+ (1,0) [0|0] "" A
 SG_ one m0 : 8|8@1+ (1,0) [0|0] "" A
 SG_ two m1 : 8|16@1- (1,0) [0|0] "" A
BO_ 103 Short: 2 A
 SG_ whole : 0|16@1+ (1,-100) [0|0] "" A
VAL_ 100 named 0 "off" 1 "on" 7 "7 of 7" ;
SIG_VALTYPE_ 101 number : 1;
"""


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short logs are read in several stretches too."""
    monkeypatch.setattr(open_log, "_PIECE_BYTES", 1 << 13)
    monkeypatch.setattr(open_log, "_LEAST_BYTES", 1)


def _mixed_log(path: Path) -> Path:
    """A run; in its second half each hundredth line is no data frame, is of nobody, or has a longer channel."""
    lines = run_log().read_text().splitlines()
    chance = random.Random(1)
    odd = [
        "hello",
        "(0946684833.300000) fleet 123#R",
        "(0946684833.300000) fleet 123##1AA",
        "(0946684833.300000) fleet 20000004#0000000000000000",
        "(0946684833.300000) a-longer-name 1FFFFF01#00",
        "(0946684833.300000) fleet 123#0102",
        "(19466848330.300000) fleet 123#0102",
    ]
    for at in range(len(lines) // 2, len(lines), 100):
        lines.insert(at, chance.choice(odd))
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


@pytest.mark.parametrize("letters", [["-ta"], ["-tz"], ["-td", "-c"]])
@pytest.mark.parametrize("is_mixed", [False, True])
def test_a_log_is_put_into_words_by_columns_as_frame_by_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], letters: list[str], *, is_mixed: bool
) -> None:
    log = _mixed_log(tmp_path / "mixed.log") if is_mixed else run_log()
    dbc = tmp_path / "site.dbc"
    dbc.write_text(site_dbc(SITE))
    capsys.readouterr()
    for by in (["--site", str(SITE_FILE)], ["--dbc", str(dbc)]):
        command = ["dump", str(log), "--decode", *letters, *by]
        assert main(command) == 0
        together = capsys.readouterr()
        # Who asks for a number of frames is answered one by one.
        assert main([*command, "-n", "10000000"]) == 0
        assert capsys.readouterr() == together


@pytest.mark.parametrize("is_mixed", [False, True])
def test_a_log_is_judged_by_columns_as_frame_by_frame(tmp_path: Path, *, is_mixed: bool) -> None:
    log_file = _mixed_log(tmp_path / "mixed.log") if is_mixed else run_log()
    site = SITE
    together, one_by_one = Checks(site), Checks(site)
    blocks = 0
    with Log(str(log_file)) as log:
        for portion in log.portions():
            for raw in portion.frames:
                one_by_one.feed_raw(raw)
    with Log(str(log_file)) as log:
        for portion in log.portions():
            if portion.block is not None:
                blocks += 1
                together.feed_block(portion.block)
    assert blocks > 1
    assert together.finish().to_json() == one_by_one.finish().to_json()


def test_frames_of_any_dbc_are_said_as_cantools_decodes_them() -> None:
    dbc, cantools = AnyDbc(DBC), load_string(DBC, database_format="dbc", strict=False)
    assert isinstance(cantools, Database)
    chance = random.Random(2)
    for number in range(4_000):
        data = chance.randbytes(chance.choice((8, 8, 8, 5, 2, 0)))
        if number % 5 == 0:
            data = bytes([number % 3]) + data[1:]
        can_id = chance.choice((100, 101, 102, 103))
        decoded = dbc.decode(can_id, data, is_extended=False)
        assert decoded is not None
        message = cantools.get_message_by_frame_id(can_id)
        units = {signal.name: signal.unit or "" for signal in message.signals}
        try:
            values = message.decode(data, allow_truncated=True)
        except Exception:  # noqa: BLE001  # whatever cantools says of it, the bytes are shown
            assert decoded.text == f"data {data.hex().upper() or 'none'}"
            continue
        assert isinstance(values, dict)
        said = {
            name: f"{name} " + (f"{value:.10g}" if isinstance(value, float) else str(value))
            for name, value in values.items()
        }
        named = {name for name, value in values.items() if not isinstance(value, int | float)}
        expected = [text if name in named else f"{text} {units[name]}".rstrip() for name, text in said.items()]
        assert decoded.text == ", ".join(expected)


def test_a_key_holds_a_whole_frame(tmp_path: Path) -> None:
    frames = [RawFrame(5, "a", 0x7FF, b""), RawFrame(6, "a", 0x7FF, b"\0"), RawFrame(7, "a", 0x7FF, b"\0", True)]
    log_file = tmp_path / "a.log"
    log_file.write_text("".join(f"{log_line(frame)}\n" for frame in frames * 500))
    with Log(str(log_file)) as log:
        block = next(log.portions()).block
    assert block is not None
    assert len(set(block.keys)) == len(frames)

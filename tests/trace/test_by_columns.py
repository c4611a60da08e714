"""What is shown and judged by columns: the same as frame by frame."""

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cantools.database import load_string
from cantools.database.can.database import Database

from onboard.contract.codes import KindCode, MachineState, Reason
from onboard.contract.messages import BusTime, Halted, Heartbeat, Message, Progress, Waiting
from onboard.trace.check.checks import Checks
from onboard.trace.cli import main
from onboard.trace.dump.formats import log_line
from onboard.trace.raw import RawFrame
from onboard.trace.readers import open_log
from onboard.trace.readers.open_log import Log
from onboard.wire.codec import fleet_codec
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


def _frame_line(message: Message) -> str:
    (frame,) = fleet_codec().encode(message)
    return f"fleet {frame.arbitration_id:08X}#{frame.data.hex().upper()}"


_BEAT = Heartbeat(1, 2, SITE.digest, 7, 1, KindCode.ROBOT, MachineState.WORKING, 0)
_BEAT_ID = fleet_codec().identifier_of("Heartbeat")
#: Odd things of one kind that may be on a bus between the frames of a run: what follows the time of a line.
_ODD: dict[str, list[str]] = {
    "unknown": ["fleet 1FFFFF01#00", "fleet 123#0102", "fleet 00000001#", "fleet 7FF#1122334455667788"],
    "short": [f"fleet {_BEAT_ID + 1:08X}#0102", f"fleet {_BEAT_ID + 2:08X}#", "fleet 0E480001#00"],
    "long": [_frame_line(_BEAT) + "_F", _frame_line(_BEAT) + " R"],
    "out of range": [f"fleet {_BEAT_ID + 1:08X}#FFFFFFFFFFFFFFFF", "fleet 01100001#FFFFFFFFFFFFFFFF"],
    "from nobody": [f"fleet {_BEAT_ID:08X}#FEBF720000010100", _frame_line(replace(_BEAT, sender=200))],
    "beats": [
        _frame_line(replace(_BEAT, sender=node, boot=boot, mirror_digest=digest, state=state))
        for node in sorted(SITE.machines)[:3]
        for boot in (1, 2)
        for digest in (0, 0xFFFF)
        for state in (MachineState.STARTING, MachineState.WORKING, MachineState.OBSTACLE)
    ],
    "halts": [
        *(
            _frame_line(Halted(node, node, Reason.ACTUATOR_FAULT, 0, needs_person, 1))
            for node in sorted(SITE.machines)[:3]
            for needs_person in (False, True)
        ),
        *(_frame_line(replace(_BEAT, sender=node)) for node in sorted(SITE.machines)[:3]),
    ],
    "other bus": ["MR1 " + _frame_line(_BEAT).split()[1], "z 01100001#1010002000000001", "z 0E480001#00"],
    "error": ["fleet 20000004#0004000000000000", "fleet 20000080#0000000000000000"],
    "remote": ["fleet 123#R", f"fleet {_BEAT_ID + 1:08X}#R8"],
    "CAN FD": ["fleet 123##1AABB", f"fleet {_BEAT_ID + 1:08X}##0FEBF720000010100"],
    "no lines": ["fleet", "fleet 123456789#00", "fleet 123#0", ""],
}


def _odd_log(path: Path, odd: list[str], *, step_us: int) -> Path:
    """A run with odd lines in between, each ``step_us`` after the one before: below 0 it goes back."""
    chance = random.Random(len(odd))
    lines = []
    for number, line in enumerate(run_log().read_text().splitlines()):
        lines.append(line)
        if number % 7 == 3:
            seconds, microseconds = line[1:].split(")")[0].split(".")
            time_us = int(seconds) * 1_000_000 + int(microseconds) + step_us
            lines.append(f"({time_us // 1_000_000:010d}.{time_us % 1_000_000:06d}) {chance.choice(odd)}")
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def _verdicts(log_file: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is judged by columns, and frame by frame."""
    together, one_by_one = Checks(SITE), Checks(SITE)
    with Log(str(log_file)) as log:
        for portion in log.portions():
            if portion.block is not None:
                together.feed_block(portion.block)
    with Log(str(log_file)) as log:
        for raw in log.one_by_one():
            one_by_one.feed_raw(raw)
    return together.finish().to_json(), one_by_one.finish().to_json()


def _said_log(path: Path, said: list[tuple[int, Message]]) -> Path:
    """A log of messages at seconds."""
    path.write_text("".join(f"({time_s:010d}.000000) {_frame_line(message)}\n" for time_s, message in said))
    return path


def test_a_sign_of_life_behind_a_halt_is_news_though_it_was_heard_before(tmp_path: Path) -> None:
    one, other, *_ = (node for node, machine in SITE.machines.items() if machine.kind is KindCode.ROBOT)
    beat = replace(_BEAT, sender=one)
    home = SITE.machines[other].home
    said: list[tuple[int, Message]] = [
        (1, beat),
        (2, Halted(one, one, Reason.ACTUATOR_FAULT, 0, True, 1)),
        (3, beat),
        (4, Waiting(other, home.track, home.index, one, Reason.NONE)),
        (34, Progress(other, 1, 0, home.track, home.index, 0, 500)),
    ]
    together, one_by_one = _verdicts(_said_log(tmp_path / "halt.log", said))
    assert together == one_by_one
    assert together["waits_us"] == {other: 30_000_000}


def test_a_start_is_news_though_it_was_heard_before(tmp_path: Path) -> None:
    start = replace(_BEAT, state=MachineState.STARTING)
    said: list[tuple[int, Message]] = [
        (1, start),
        (2, BusTime(1, 2_000_000)),
        (3, start),
        (12, BusTime(1, 3_000_000)),
    ]
    together, one_by_one = _verdicts(_said_log(tmp_path / "start.log", said))
    assert together == one_by_one
    assert together["runs"] == 2


@pytest.mark.parametrize("step_us", [10, -1_500_000, -20])
@pytest.mark.parametrize("kind", _ODD)
def test_odd_frames_are_shown_and_judged_by_columns_as_frame_by_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, step_us: int
) -> None:
    log_file = _odd_log(tmp_path / "odd.log", _ODD[kind], step_us=step_us)
    together, one_by_one = _verdicts(log_file)
    assert together == one_by_one
    command = ["dump", str(log_file), "--decode", "--site", str(SITE_FILE)]
    capsys.readouterr()
    assert main(command) == 0
    shown = capsys.readouterr()
    assert main([*command, "-n", "10000000"]) == 0
    assert capsys.readouterr() == shown


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

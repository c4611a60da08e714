"""``onboard trace dump --decode``: one readable line a message, in the words of the site or of any DBC."""

import os
from pathlib import Path

import pytest

from onboard.contract.codes import (
    CallResult,
    Criterion,
    Grade,
    KindCode,
    LegAction,
    Operation,
    Reason,
    Side,
    TaskPhase,
    TokenKind,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Itinerary,
    Leg,
    Message,
    Progress,
    Reference,
    Stamp,
    TaskReport,
    TokenRefusal,
    Waiting,
)
from onboard.trace.candump import format_line
from onboard.trace.cli import main
from onboard.wire.codec import codecs

CONTRACTS = codecs()
SITE = Path(__file__).parents[2] / "bus_sim" / "sites" / "small.toml"
START_US = 946_684_800_000_000


def _log(path: Path, *messages: Message) -> Path:
    lines = []
    for number, message in enumerate(messages):
        lines += [format_line(START_US + 1000 * number, "fleet", frame) for frame in CONTRACTS.fleet.encode(message)]
    path.write_text("\n".join(lines) + "\n")
    return path


CALL = CallForProposals(
    1, 7, Reference(1, 3), Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, 5_000, 0x0101, ANY_STATION,
    Reference(1, 3), 2700,
)  # fmt: skip


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (
            Award(1, 7, 11, Reference(1, 3), 1, CallResult.AWARDED, Reason.NONE),
            "IOC1 Award: call 7, winner MR1, task IOC1/3, task version 1, result awarded, reason none",
        ),
        (
            Progress(11, 3, 1, 2, 4, -20, 1500),
            "MR1 Progress: at p(2,4), itinerary version 3, leg 1, offset -20 mm, speed 1500 mm/s",
        ),
        (Waiting(11, 2, 4, 12, Reason.NOT_AUTHORISED), "MR1 Waiting: at p(2,4), blocker MR2, reason not authorised"),
        (
            TokenRefusal(5, TokenKind.STATION, 0x0285, 9, 11, Reason.MIRROR_BEHIND),
            "ER1 TokenRefusal: token p(2,5)F, version 9, requester MR1, reason mirror behind",
        ),
        (
            TaskReport(77, Reference(1, 3), TaskPhase.DONE, 0xFFFE, Reason.NONE),
            "node 77 TaskReport: task IOC1/3, phase done, station outside, reason none",
        ),
        (
            Itinerary(
                11, 4, Grade.FIRM, Stamp(5_000, 1, 7), (Leg(LegAction.TRAVEL, 2, 4, 9, Side.NEAR, 9_500),
                Leg(LegAction.WORK, 2, 9, 9, Side.FAR, 20_000)),
            ),
            "MR1 Itinerary: version 4, grade firm, stamp 5.000 s by IOC1 call 7, "
            "legs travel p(2,4)..p(2,9) until 9.500 s; work p(2,9) far until 20.000 s",
        ),
    ],
)  # fmt: skip
def test_p31_a_message_is_one_line_in_the_words_of_the_site(
    message: Message, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["dump", str(_log(tmp_path / "one.log", message)), "--decode", "--site", str(SITE)]) == 0
    assert capsys.readouterr().out.splitlines() == [f" (0946684800.000000)  fleet  {words}"]


def test_a_bids_cost_has_the_unit_of_its_call(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = _log(tmp_path / "bids.log", CALL, Bid(11, 1, 7, 43_210, 4), Bid(11, 1, 8, 99, 0))
    assert main(["dump", str(log), "--decode", "-tz", "--site", str(SITE)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3, "the frames of one call are one message"
    assert "IOC1 CallForProposals: call 7, task IOC1/3, operation park, kind robot" in lines[0]
    assert "to station anywhere" in lines[0] and "deadline 5.000 s" in lines[0]
    assert lines[1:] == [
        " (000.001000)  fleet  MR1 Bid: initiator IOC1, call 7, cost 43.210 s, itinerary version 4",
        " (000.002000)  fleet  MR1 Bid: initiator IOC1, call 8, cost 99, itinerary version 0",
    ]


def test_what_is_no_message_is_shown_raw_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "odd.log"
    log.write_text(
        "(1.000000) fleet 123#01\n(1.000000) fleet 12500001#01E9\n(1.000000) fleet 123##4AA\n"
        "(1.000000) fleet 20000004#000C000000000000\n(1.000000) fleet 0C40000B#0106000000000B00\n"
    )
    assert main(["dump", str(log), "--decode", "-e"]) == 0
    told = capsys.readouterr()
    assert [line.strip() for line in told.out.splitlines()] == [
        "(0000000001.000000)  fleet  123#01  (unknown identifier)",
        "(0000000001.000000)  fleet  12500001#01E9  (short frame)",
        "(0000000001.000000)  fleet       123  [01]  AA".replace("     123", "123"),
        "(0000000001.000000)  fleet  20000004   [8]  00 0C 00 00 00 00 00 00   ERRORFRAME",
        "controller-problem{rx-error-warning,tx-error-warning}",
    ]
    for line in ("CAN FD frames: 1", "error frames: 1", "(short frame): 1", "(unknown identifier): 1"):
        assert line in told.err
    assert "sets that were not whole at the end: 1" in told.err


FOREIGN = """\
VERSION ""

NS_ :
  NS_DESC_

BO_ 291 Engine: 4 ECU
 SG_ Speed : 0|16@1+ (0.25,0) [0|16000] "rpm" XXX
 SG_ Gear : 16|8@1+ (1,0) [0|8] "" XXX
 SG_ Warm : 24|1@1+ (1,0) [0|1] "" XXX

VAL_ 291 Gear 1 "First" 2 "Second" ;
"""


def test_any_dbc_will_do_and_what_it_lacks_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dbc, log = tmp_path / "car.dbc", tmp_path / "car.log"
    dbc.write_text(FOREIGN)
    log.write_text(
        "(1.000000) can0 123#A00F0200\n(2.000000) can0 123#A00F\n"
        "(3.000000) can0 456#00\n(4.000000) can0 00000123#A00F0200\n"
    )
    assert main(["dump", str(log), "--decode", "-tz", "--dbc", str(dbc)]) == 0
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        " (000.000000)  can0  Engine: Speed 1000 rpm, Gear Second, Warm 0",
        " (001.000000)  can0  Engine: Speed 1000 rpm  (short frame: 2 of 4 bytes)",
        " (002.000000)  can0  456#00  (unknown identifier)",
        " (003.000000)  can0  00000123#A00F0200  (unknown identifier)",
    ]
    assert told.err.splitlines() == [
        f"{dbc}: without BS_ and BU_: read as if both were there and empty",
        f"{log}: unknown identifiers: 2 frames (456 1, 00000123 1)",
        f"{log}: short frames: 1 frames (Engine 1)",
    ]


def test_a_file_that_is_no_dbc_is_one_clear_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dbc, log = tmp_path / "car.dbc", tmp_path / "car.log"
    dbc.write_text("BO_ hello\n")
    log.write_text("(1.000000) can0 123#00\n")
    assert main(["dump", str(log), "--decode", "--dbc", str(dbc)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"onboard trace: {dbc}: not a DBC (") and said.count("\n") == 1


#: A directory with recorded vehicles (``<name>.log`` or ``.asc`` beside a ``.dbc``); see docs/trace.md.
SAMPLES = os.environ.get("CAN_SAMPLES")


def test_recorded_vehicles_lose_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Real recordings are not ours to ship: without the directory there is nothing to do here."""
    for dbc in sorted(Path(SAMPLES).rglob("*.dbc")) if SAMPLES else ():
        for log in sorted((*dbc.parent.glob("*.log"), *dbc.parent.glob("*.asc"))):
            assert main(["dump", str(log), "--decode", "--dbc", str(dbc)]) == 0
            told = capsys.readouterr()
            frames = [line for line in log.read_text().splitlines() if "#" in line or "\tRx" in line or "\tTx" in line]
            assert len(told.out.splitlines()) == len(frames), log

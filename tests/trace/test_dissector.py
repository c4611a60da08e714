"""The generated Wireshark dissector, tried in tshark: it says what our own decoder says, and its fields filter."""

from pathlib import Path

import pytest

from onboard.contract.messages import Bid, BusTime, Progress
from onboard.trace.cli import main
from tests.tools import require_tool, run_tool
from tests.trace.runs import SITE_FILE, fleet_of, run_log


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """The dissector, and a capture of a run."""
    require_tool("tshark")
    folder = tmp_path_factory.mktemp("wireshark")
    capture, script = folder / "run.pcapng", folder / "onboard.lua"
    assert main(["convert", str(run_log()), str(capture)]) == 0
    with pytest.MonkeyPatch.context() as patch, script.open("w") as file:
        patch.setattr("sys.stdout", file)
        assert main(["dissector", str(SITE_FILE)]) == 0
    return str(script), str(capture)


def _shark(files: tuple[str, str], wanted: str, *names: str) -> list[list[str]]:
    script, capture = files
    fields = [word for name in names for word in ("-e", name)]
    told = run_tool("tshark", "-X", f"lua_script:{script}", "-r", capture, "-Y", wanted, "-T", "fields", *fields)
    return [line.split("\t") for line in told.splitlines()]


def test_signals_read_as_in_our_own_decoder(files: tuple[str, str]) -> None:
    said = [one.message for one in fleet_of(run_log())]
    progress = [
        [str(one.sender), str(one.track), str(one.index), str(one.offset_mm), str(one.speed_mm_s)]
        for one in said
        if isinstance(one, Progress)
    ]
    fields = ("track", "index", "offset_mm", "speed_mm_s")
    names = ["onboard.sender", *(f"onboard.progress.{name}" for name in fields)]
    assert _shark(files, "onboard.progress.track", *names) == progress
    assert any(row[3].startswith("-") for row in progress), "a negative value is among them"
    times = [[str(one.bus_time_us)] for one in said if isinstance(one, BusTime)]
    assert _shark(files, "onboard.bustime.bus_time_us", "onboard.bustime.bus_time_us") == times


def test_signals_and_names_filter(files: tuple[str, str]) -> None:
    bids = [one.message for one in fleet_of(run_log()) if isinstance(one.message, Bid)]
    dear = [[str(bid.cost)] for bid in bids if bid.cost > 100_000 and bid.sender == 12]
    assert dear
    wanted = 'onboard.bid.cost > 100000 && onboard.sender.name == "MR2"'
    assert _shark(files, wanted, "onboard.bid.cost") == dear


def test_every_frame_of_both_contracts_is_known(files: tuple[str, str]) -> None:
    assert _shark(files, "!onboard", "frame.number") == []


def test_frames_of_others_are_left_to_wireshark(files: tuple[str, str], tmp_path: Path) -> None:
    log, capture = tmp_path / "other.log", tmp_path / "other.pcapng"
    log.write_text("(1.000000) can0 123#0102\n(1.000000) can0 12500001#01\n(1.000000) can0 1FFFFF01#0102030405060708\n")
    assert main(["convert", str(log), str(capture)]) == 0
    assert _shark((files[0], str(capture)), "onboard", "frame.number") == []
    assert len(_shark((files[0], str(capture)), "can", "frame.number")) == 3

"""A controller run again against what was recorded: the same code decides the same, other costs show in a bid."""

from pathlib import Path

import pytest

from onboard.contract.messages import Bid
from onboard.trace.cli import main
from onboard.wire.codec import fleet_codec
from tests.trace.runs import SITE_FILE, fleet_of, run_log


def _replay(capsys: pytest.CaptureFixture[str], *words: str, log: Path | None = None) -> tuple[int, str]:
    status = main(["replay", str(log or run_log()), "--site", str(SITE_FILE), *words])
    told = capsys.readouterr()
    return status, told.out + told.err


@pytest.mark.parametrize("machine", ["MR1", "MR2", "ER1", "IOC1"])
def test_the_same_code_says_every_frame_again(machine: str, capsys: pytest.CaptureFixture[str]) -> None:
    run_log()
    capsys.readouterr()
    status, told = _replay(capsys, "--machine", machine)
    assert (status, told.splitlines()[-1].split(": ")[1].partition(" ")[2]) == (
        0,
        "frames on fleet and device bus, all the same",
    )
    assert int(told.split()[1]) > 200


@pytest.mark.parametrize(("machine", "node"), [("MR1", 11), ("MR2", 12)])
def test_costs_that_are_one_higher_show_in_the_first_bid(
    machine: str, node: int, capsys: pytest.CaptureFixture[str]
) -> None:
    said = [one.message for one in fleet_of(run_log())]
    bid = next(one for one in said if isinstance(one, Bid) and one.sender == node)
    capsys.readouterr()
    status, told = _replay(capsys, "--machine", machine, "--raise-costs", "1")
    lines = told.splitlines()
    codec = fleet_codec()
    dearer = Bid(node, bid.initiator, bid.call, bid.cost + 1, bid.itinerary_version)
    for line, one in zip(lines[1:], (bid, dearer), strict=True):
        frame = codec.encode(one)[0]
        assert line.split()[1:] == [f"{frame.arbitration_id:08X}#{frame.data.hex().upper()}", "(Bid)"]
    assert status == 1 and " differs:" in lines[0]


def test_a_frame_that_was_changed_in_the_log_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = run_log().read_text().splitlines(keepends=True)
    number, line = next((n, one) for n, one in enumerate(lines) if " MR1 1480000B#" in one)
    lines[number] = line.replace(line.strip()[-4:], "0001")
    path = tmp_path / "changed.log"
    path.write_text("".join(lines))
    capsys.readouterr()
    status, told = _replay(capsys, "--machine", "MR1", log=path)
    assert status == 1
    assert f"recorded: {lines[number].split()[2]} (DriveOrder)" in told
    assert f"now:      {line.split()[2]} (DriveOrder)" in told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--machine", "MR9"], "--machine MR9: not at site"),
        (["--machine", "MR1", "--bus", "can0"], "MR1 says nothing on bus 'can0' there"),
    ],
)
def test_a_mistake_is_one_clear_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    run_log()
    capsys.readouterr()
    status, told = _replay(capsys, *words)
    assert status == 2 and said in told and told.count("\n") == 1


def test_a_log_without_the_machines_own_bus_or_of_another_site_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = run_log().read_text().splitlines(keepends=True)
    path = tmp_path / "fleet.log"
    path.write_text("".join(line for line in lines if " fleet " in line))
    capsys.readouterr()
    assert "without the device bus of MR1" in _replay(capsys, "--machine", "MR1", log=path)[1]
    status = main(["replay", str(run_log()), "--site", str(SITE_FILE.with_name("standard.toml")), "--machine", "MR1"])
    assert status == 2 and "recorded at a site of digest" in capsys.readouterr().err

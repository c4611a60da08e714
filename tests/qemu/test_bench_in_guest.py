"""The bench on the Linux CAN stack: a scenario with a device behind SocketCAN in a namespace of its own.

The gate plays the one that needs most of the bench (power, files, both buses); "survives unplugging" passes there too,
and the others can be played by hand. The emulated processor needs ten seconds for each start of the device.
"""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from hil.guest.machine import GuestRun, run_guest
from onboard.trace.candump_reader import CandumpReader
from tests.qemu.guest import ROOT, once, require_guest

PLAYED = "moves under authority"
LIMIT_S = 800.0


def play(share: Path) -> GuestRun:
    settings = f"export PYTHONPATH={ROOT} PYTHONDONTWRITEBYTECODE=1 COLUMNS=200"
    words = f"{sys.executable} -m hil.guest.bench /run/share -k {PLAYED.rsplit(maxsplit=1)[-1]}"
    return run_guest(f"{settings}\nexec {words}\n", share, limit_s=LIMIT_S)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[ET.Element, Path]:
    """The one test that was played in the guest, as its report tells it, and the shared folder."""
    require_guest()
    share = once(tmp_path_factory, "bench", play)
    (found,) = ET.parse(share / "report.xml").iter("testcase")
    return found, share


def test_a_scenario_passes_with_a_device_behind_socketcan(case: tuple[ET.Element, Path]) -> None:
    found, _ = case
    assert found.get("name") == f"test_scenario[MR1 {PLAYED}]"
    assert [child.tag for child in found] == ["properties"], ET.tostring(found)


def test_its_latencies_are_told_and_its_trace_is_kept(case: tuple[ET.Element, Path]) -> None:
    found, share = case
    told = {one.get("name"): str(one.get("value")) for one in found.iter("property")}
    # From the call to the bid less than the window of a call; the emulated processor is a slow one.
    assert 0 < int(told["call_to_bid_worst_us"]) < 1_000_000
    assert 0 < int(told["grant_to_motion_worst_us"]) < 1_000_000
    with (share / Path(told["trace"]).relative_to("/run/share")).open("rb") as lines:
        assert {record.channel for record in CandumpReader(lines)} >= {"fleet", "MR1"}

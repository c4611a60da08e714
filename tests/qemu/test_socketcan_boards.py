"""Emulated CAN controllers with the driver of real ones.

What this cannot show: the emulated bus knows no bit timing, no arbitration, no missing acknowledgement and no error
frame, so that no controller becomes error-passive. QEMU's controller (7.2) also garbles frames with 11-bit identifiers
and remote frames, which the fleet does not use: five checks of the conformance body fail there, so it has no arm.
"""

import json
from pathlib import Path

import pytest

from hil.guest.machine import GuestRun, run_guest
from hil.guest.quick import QUICK
from onboard.config.site import parse_site
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.check.checks import Checks, check_records
from tests.qemu.guest import ROOT, once, require_guest, scene_script

SITE = (ROOT / "bus_sim" / "sites" / "level1.toml").read_text(encoding="utf-8") + QUICK
MACHINES = ("IOC1", "MR1")
BITRATE = 250_000
#: Four nodes: two machines, the plant that listens, a person's tools.
CONTROLLERS = ["-object", "can-bus,id=bus0", *4 * ["-device", "kvaser_pci,canbus=bus0"]]
#: Of the guest's own time.
LIMIT_S = 400.0


def play(share: Path) -> GuestRun:
    share.mkdir()
    (share / "site.toml").write_text(SITE)
    begin = ["--one-car", "1", "--seed", "3", "--for", "150", "--trace", "plant.log", "--json", "figures.json"]
    (share / "order.json").write_text(json.dumps({"machines": MACHINES, "begin": begin}))
    (share / "plan.json").write_text(json.dumps({"bitrate": BITRATE}))
    return run_guest(scene_script("tests.qemu.boards_scene"), share, limit_s=LIMIT_S, devices=CONTROLLERS)


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished run of the small scene."""
    require_guest()
    return once(tmp_path_factory, "boards", play)


def test_a_car_is_served_over_a_real_driver_and_the_log_passes_the_checkers(boards: Path) -> None:
    figures = json.loads((boards / "figures.json").read_text())
    assert (figures["cars_in"], figures["cars_out"], figures["violations"]) == (1, 1, [])
    with (boards / "fleet.log").open("rb") as lines:
        verdict = check_records(CandumpReader(lines), Checks(parse_site(SITE, "site.toml")))
    assert verdict.is_good, "\n".join(verdict.lines())


def test_the_controllers_have_the_bit_rate_asked_for_and_no_errors(boards: Path) -> None:
    links = json.loads((boards / "found.json").read_text())["links"]
    assert set(links) == {*MACHINES, "tools"}
    for link in links.values():
        settings = link["linkinfo"]["info_data"]
        assert settings["state"] == "ERROR-ACTIVE"
        assert settings["bittiming"]["bitrate"] == BITRATE
        assert settings["restart_ms"] == 100
        assert settings["bittiming_const"]["name"] == "sja1000"
        assert link["txqlen"] == 1000
        assert (link["stats64"]["rx"]["errors"], link["stats64"]["tx"]["errors"]) == (0, 0)

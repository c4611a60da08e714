"""The conformance body's third arm: python-can's SocketCAN on the Linux CAN stack, in a guest."""

import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hil.guest.initrd import SHARE, WORK
from hil.guest.machine import GuestRun, run_guest
from tests.io.test_conformance import VIRTUAL
from tests.qemu.guest import ROOT, once, require_guest

#: Of the guest's own time.
LIMIT_S = 400.0


def conform(share: Path) -> GuestRun:
    share.mkdir()
    # Plugins that this body does not use, hypothesis above all, would take the emulated processor longer than it does.
    words = f"-q -p pytest_asyncio.plugin --noconftest --basetemp={WORK}/pytest --junitxml={SHARE}/junit.xml"
    script = (
        f"export PYTHONPATH={ROOT} PYTHONDONTWRITEBYTECODE=1 PYTEST_DISABLE_PLUGIN_AUTOLOAD=1\ncd {ROOT}\n"
        f"{sys.executable} -m pytest -p no:cacheprovider {words} tests/qemu/guest_conformance.py\nexit 0\n"
    )
    return run_guest(script, share, limit_s=LIMIT_S)


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Of every check that ran in the guest what it said where it failed; nothing where it passed."""
    require_guest()
    share = once(tmp_path_factory, "conformance", conform)
    cases = ElementTree.parse(share / "junit.xml").iter("testcase")
    return {
        case.attrib["name"]: " ".join((one.text or one.attrib["message"])[-2000:] for one in case) for case in cases
    }


@pytest.mark.parametrize("check", [check.__name__ for check in VIRTUAL])
@pytest.mark.parametrize("arm", ["vcan", "mesh"])
def test_socketcan_conforms(arm: str, check: str, verdicts: dict[str, str]) -> None:
    assert verdicts[f"test_{arm}[{check}-{arm}]"] == ""

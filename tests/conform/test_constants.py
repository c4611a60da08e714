"""Constants for which the play was not written are named; with all others our robot keeps every check."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from onboard.cli import main as onboard
from onboard.conform.checks import Verdict
from onboard.conform.suite import unlike
from onboard.systems.car_park.conform.constants import PLAYED_WITH
from onboard.systems.car_park.site import CarPark
from tests.conform.bench import SITE, SITES, play
from tests.thinned import some

BENCH = Path(__file__).parent / "bench.toml"
#: Each end of a range that is none of the benches', by its key.
ENDS = [(one.key, end) for one in PLAYED_WITH for end in (one.low, one.high) if end != one.of(SITE)]


def with_time(site: CarPark, key: str, ms: int) -> CarPark:
    times: dict[str, Any] = {f"{key.removeprefix('timing.').removesuffix('_ms')}_us": ms * 1000}
    return replace(site, timing=replace(site.timing, **times))


def test_the_benches_have_none_of_them() -> None:
    assert [unlike(site) for site in SITES] == [[], [], [], []]


@pytest.mark.parametrize(("key", "end"), some(ENDS, 2))
def test_within_its_ranges_our_robot_keeps_every_check(key: str, end: int) -> None:
    for site in SITES:
        changed = with_time(site, key, end)
        assert unlike(changed) == []
        assert [one.check.name for one in play(site=changed).findings.of(Verdict.FAILED)] == []


def test_whoever_benches_with_others_is_told_which(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a heartbeat of a second a robot that keeps all of its duties was found to break seven."""
    file = tmp_path / "quick.toml"
    file.write_text(f"{BENCH.read_text(encoding='utf-8')}\n[timing]\nheartbeat_ms = 1000\n", encoding="utf-8")
    words = [
        "conform",
        "-i",
        "socketcand-asyncio",
        "-c",
        "none",
        "--site",
        str(file),
        "--node",
        "11",
        "--kind",
        "robot",
    ]
    assert onboard([*words, "--bus-kwargs", "host=127.0.0.1", "port=1"]) == 2
    told = capsys.readouterr().err.splitlines()
    assert told[0].startswith("onboard conform: site bench: timing.heartbeat_ms = 1000 (2000): what fails may be")

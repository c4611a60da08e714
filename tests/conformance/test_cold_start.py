"""After a common power cut every site starts by itself, also with any one machine missing (issue 13, point 1)."""

import pytest

from bus_sim.campaign.cold_start import MOMENTS_S, STARTS_S, Start, cold_start, cold_starts
from bus_sim.cli import main
from bus_sim.sites import find_site
from tests.conformance.cases import CASES
from tests.conformance.runs import site_file

#: Sites of all systems that take little time; the rest by ``bus-sim campaign SITE --cold-start``.
CHEAP = ("level1", *CASES)


@pytest.mark.parametrize("name", CHEAP)
def test_every_machine_that_has_power_takes_part_in_time(name: str) -> None:
    file = site_file(name) if name in CASES else name
    starts = list(cold_starts(find_site(file), file, MOMENTS_S[:1]))
    assert len(starts) == 1 + len(find_site(file).machines)
    assert [str(one) for one in starts if not one.is_good] == []
    assert all(0 < one.longest_s <= STARTS_S for one in starts if one.missing is None)


@pytest.mark.parametrize("missing", [None, "MR1"])
def test_a_lift_takes_part_though_the_robot_that_has_its_platform_is_missing(missing: str | None) -> None:
    """It waited in its start until that robot told a plan."""
    start = cold_start(find_site("small"), "small", MOMENTS_S[2], missing)
    assert start.is_good, str(start)


def test_who_does_not_come_back_is_named() -> None:
    start = Start("small", 45.0, None, 12.0, ("ER1",), ())
    assert not start.is_good
    assert "NOT in time: ER1" in str(start)


def test_the_command_tells_each_start_and_fails_with_any(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["campaign", "level1", "--cold-start"]) == 0
    *starts, summary = capsys.readouterr().out.splitlines()
    assert len(starts) == 3 * len(MOMENTS_S)
    assert summary.startswith("9 starts, 0 failed; at most ")
    monkeypatch.setattr("bus_sim.campaign.cold_start.STARTS_S", 1.0)
    assert main(["campaign", "level1", "--cold-start"]) == 1


def test_a_sample_of_the_starts_is_spread_over_moments_and_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    played: list[tuple[float, str | None]] = []

    def start(_site: object, name: str, at_s: float, missing: str | None) -> Start:
        played.append((at_s, missing))
        return Start(name, at_s, missing, 1.0, (), ())

    monkeypatch.setattr("bus_sim.campaign.cold_start.cold_start", start)
    site = find_site("level1")
    assert len(list(cold_starts(site, "level1", sample=4))) == 4
    assert {at_s for at_s, _ in played} == set(MOMENTS_S)
    assert len({missing for _, missing in played}) > 1
    assert len(list(cold_starts(site, "level1", sample=100))) == 9

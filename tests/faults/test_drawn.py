"""Sites drawn by chance are played as a campaign plays shipped ones, and are the same wherever they are drawn."""

from pathlib import Path

import pytest

from bench.drawn import DRAWN, drawn_site, main
from bus_sim.campaign.profiles import draw_faults
from bus_sim.campaign.report import FAILURES
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from onboard.config.site import parse_site


@pytest.mark.parametrize("system", DRAWN)
def test_drawn_sites_are_served_under_faults(system: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["14-15", "--system", system, "--cars", "8", "--out", str(tmp_path)]) == 0
    first, second, last = capsys.readouterr().out.splitlines()
    assert (first[:8], second[:8], last) == ("site 14:", "site 15:", "2 sites, 0 failed")
    assert list(tmp_path.iterdir()) == [], "nothing is kept of what did not fail"


def cut_off(fault: Injection) -> Injection:
    """Of a machine that is off the bus, it is cut off instead."""
    if fault.kind != "bus_off":
        return fault
    given = {key: value for key, value in fault.given.items() if key != "target"}
    return Injection("partition", {**given, "members": fault.given["target"], "way": "both"})


@pytest.mark.parametrize(
    ("number", "faults"),
    [
        # A desk whose power failed missed that a box was another desk's, and counted it as its own.
        (18, "bus,outages,devices"),
        # Who was off heard of two in its lane in the wrong order, and told that for good.
        (29, "clocks,devices,outages"),
        # Two had one box in their plans, and the second one tried to pick it up where it was no more.
        (43, "crash,outages,devices"),
        # Who was off as the box above its own was given back waited for good at their stack.
        (44, "people,devices,operators"),
    ],
)
def test_yards_get_over_faults_of_several_kinds_at_once(number: int, faults: str, tmp_path: Path) -> None:
    """Each left boxes waiting for good, and nobody was told to help."""
    file = tmp_path / f"d{number}.toml"
    file.write_text(drawn_site("terminal", number), encoding="utf-8")
    site = find_site(str(file))
    demand = simulated_of(site).usual(site, {})
    span_s = simulated_of(site).faulted(site, demand, number, 3_600.0).span_s
    # Attempts without end on a dead bus cost much to play: who is off the bus is cut off.
    drawn = [cut_off(one) for one in draw_faults(faults, number, site, span_s) if one.kind != "burst"]
    report = play(site, FaultScenario(str(file), number, 3_600.0, demand, tuple(drawn)))
    assert report.verdict not in FAILURES, report.why()


@pytest.mark.parametrize("faults", ["crash,", "people,none at all"])
def test_profiles_that_are_not_there_are_named(faults: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["1", "--faults", faults])
    assert ended.value.code == 2
    assert f"--faults {faults.split(',')[1]}: no such profile; profiles are none, bus, " in capsys.readouterr().err


@pytest.mark.parametrize("system", DRAWN)
def test_a_number_is_one_site(system: str) -> None:
    one, other = drawn_site(system, 3), drawn_site(system, 4)
    assert one == drawn_site(system, 3) != other
    assert parse_site(one, "d3.toml").name == "d3"
    assert parse_site(one, "d3.toml").system == ("car-park" if system == "lines" else system)

"""Seeds of a small site under faults: safety in every run, and everybody served or told why."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bus_sim.campaign.profiles import draw_faults
from bus_sim.campaign.report import FAILURES, RunVerdict, TrialReport
from bus_sim.campaign.runner import CampaignSettings, TrialResult, run_campaign, run_seed
from bus_sim.campaign.table import lines, to_json
from bus_sim.campaign.trial import play
from bus_sim.cli import main
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario, load_scenario
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark, DeskPolicy
from tests.thinned import some

SCENARIOS = Path(__file__).parent / "scenarios"
#: Scenarios found by campaigns that are known to fail, and why; each comes off this list with its repair.
KNOWN: dict[str, str] = {}
#: Those found since cars come to the compartment beside them where the site file says so.
AS_IT_SHIPS = {"asked_for_amid_a_power_cut"}


#: Sites and the cars of each run, as short as shows something.
CAMPAIGNS = {"level1": 3, "small": 3, "standard": 2, "large": 1}
#: How many of each site's seeds are played where not all are.
SEEDS = {"level1": 4, "small": 4, "standard": 2, "large": 1}


@pytest.mark.parametrize(
    ("name", "seed"), [(name, seed) for name in CAMPAIGNS for seed in some(range(1, 17), SEEDS[name])]
)
def test_a_site_withstands_its_bus(name: str, seed: int) -> None:
    """Safe for the oracle and for the checkers; nothing stands still, and all mirrors agree in the end."""
    site = find_site(name)
    arrivals = Arrivals(CAMPAIGNS[name], 60.0, 20.0, 100.0)
    report = play(site, FaultScenario(name, seed, 3_600.0, arrivals, draw_faults("bus", seed, site)))
    assert (report.violations, report.halted, report.error, report.waiting) == ((), (), "", 0)
    assert (report.stalls, report.is_apart) == ((), False)


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_without_faults_no_checker_finds_anything(name: str) -> None:
    report = play(find_site(name), FaultScenario(name, 3, 3_600.0, Arrivals(CAMPAIGNS[name], 60.0, 20.0, 100.0)))
    assert (report.verdict, report.violations, report.stalls, report.told) == (RunVerdict.SERVED, (), (), 0)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=pytest.mark.xfail(reason=KNOWN[path.stem], strict=True))
        if path.stem in KNOWN
        else path.stem
        for path in sorted(SCENARIOS.glob("*.toml"))
    ],
)
def test_what_a_campaign_once_found_does_not_come_back(name: str) -> None:
    scenario, site = load_scenario(SCENARIOS / f"{name}.toml")
    # Cars came to the desk that reads their tickets on every site when the others were found.
    if isinstance(site, CarPark) and name not in AS_IT_SHIPS:
        site = replace(site, desk=DeskPolicy.ANY)
    report = play(site, scenario)
    assert report.verdict not in FAILURES, report.why()


def test_a_seed_plays_the_same_in_every_process() -> None:
    plan = CampaignSettings("level1", "bus", 3_600.0, Arrivals(cars=1))
    here = {result.seed: result.report for result in run_campaign(plan, [1, 2], 1)}
    there = {result.seed: result.report for result in run_campaign(plan, [2, 1], 2)}
    assert here == there


def test_a_failure_is_shrunk_and_kept_with_its_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    faults = tuple(
        parse_injection(text)
        for text in ("burst:at_s=5", "actuator_stuck:target=IOC1,at_s=1,for_s=3000", "drift:target=MR1,at_s=9")
    )
    monkeypatch.setattr("bus_sim.campaign.runner.draw_faults", lambda *_: faults)
    result = run_seed(CampaignSettings("small", "all", 200.0, Arrivals(cars=1), tmp_path), 3)
    assert result.report.verdict is RunVerdict.NOT_SERVED
    assert result.shrunk is not None
    assert result.shrunk.faults == faults[1:2]
    kept, _ = load_scenario(tmp_path / "small-all-3.toml")
    assert kept == result.shrunk
    assert (tmp_path / "small-all-3.log").stat().st_size > 0


def test_the_table_counts_a_run_under_every_kind_that_it_had() -> None:
    scenario = FaultScenario("small", 1, faults=(parse_injection("burst:at_s=5"), parse_injection("burst:at_s=9")))
    good = TrialReport(scenario, RunVerdict.SERVED)
    bad = replace(good, verdict=RunVerdict.VIOLATION, violations=("5 s: two cars are in one place",))
    results = [TrialResult(1, good), TrialResult(2, bad, scenario, ("x.toml",))]
    text = lines(results)
    row = next(line for line in text if line.startswith("burst")).split()
    assert row == ["burst", "4", "1", *["."] * 10, "1"]
    assert any(line.startswith("2 runs, ") for line in text)
    assert "seed 2: VIOLATION: 5 s: two cars are in one place" in text
    assert to_json(CampaignSettings("small", "bus"), results)["verdicts"] == {"served": 1, "VIOLATION": 1}


def test_the_command_tells_and_answers_by_its_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = tmp_path / "figures.json"
    command = ["campaign", "small", "--seeds", "1-2", "--faults", "none", "--jobs", "1", "--cars", "1"]
    assert main([*command, "--json", str(figures), "--out", str(tmp_path / "out")]) == 0
    assert "all runs" in capsys.readouterr().out
    told = json.loads(figures.read_text(encoding="utf-8"))
    assert told["verdicts"] == {"served": 2}
    assert not (tmp_path / "out").exists()


def test_of_a_run_that_broke_off_only_what_was_before_is_played_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A day that goes wrong in its first hour costs the shrinking no days."""
    faults = tuple(parse_injection(f"burst:at_s={at_s}") for at_s in (100, 200, 3_000, 4_000, 80_000))
    played: list[FaultScenario] = []

    def broken(site: Site, scenario: FaultScenario, **_: object) -> TrialReport:
        played.append(scenario)
        is_bad = faults[1] in scenario.faults
        return TrialReport(scenario, RunVerdict.VIOLATION if is_bad else RunVerdict.SERVED, simulated_s=3_500.0)

    monkeypatch.setattr("bus_sim.campaign.runner.play", broken)
    monkeypatch.setattr("bus_sim.campaign.runner.draw_faults", lambda *_: faults)
    result = run_seed(CampaignSettings("small", "bus", 86_400.0, has_baseline=False), 1)
    assert [one.limit_s for one in played] == [86_400.0, *[4_100] * (len(played) - 1)]
    assert played[1].faults == faults[:3]
    assert result.shrunk is not None and result.shrunk.faults == faults[1:2]


def test_long_runs_bring_customers_and_faults_at_a_rate(tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    command = ["campaign", "small", "--seeds", "4", "--faults", "bus", "--jobs", "1", "--out", str(tmp_path / "out")]
    options = ["--cars", "2", "--apart", "600", "--faults-an-hour", "30", "--no-baseline"]
    assert main([*command, *options, "--json", str(figures)]) == 0
    (one,) = json.loads(figures.read_text(encoding="utf-8"))["runs"]
    times_s = [parse_injection(text).at_us / 1e6 for text in one["faults"]]  # type: ignore[union-attr]  # the profile has no faults of frames
    assert len(times_s) > 5 and max(times_s) > 1_000


def test_without_a_baseline_each_seed_is_played_once(monkeypatch: pytest.MonkeyPatch) -> None:
    played: list[int] = []

    def counted(site: Site, scenario: FaultScenario, **_: object) -> TrialReport:
        played.append(len(scenario.faults))
        return TrialReport(scenario, RunVerdict.SERVED, longest_wait_s=500.0)

    monkeypatch.setattr("bus_sim.campaign.runner.play", counted)
    for has_baseline, profile in ((True, "bus"), (False, "bus"), (True, "none"), (False, "none")):
        run_seed(CampaignSettings("small", profile, has_baseline=has_baseline), 1)
    faults = played[1]
    assert faults > 0 and played == [0, faults, faults, 0, 0]


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [
        ("--faults", "bos", "--faults bos: no such profile"),
        ("--seeds", "9-1", "--seeds 9-1: must be a seed"),
        ("--jobs", "-1", "--jobs -1: must be 1 or more"),
        ("--cars", "0", "--cars 0: must be from 1 to 100000"),
        ("--limit", "0", "--limit 0: must be above 0"),
        ("--apart", "0", "--apart 0: must be above 0"),
        ("--apart", "nan", "--apart nan: must be above 0"),
        ("--faults-an-hour", "-2", "--faults-an-hour -2: must be above 0"),
    ],
)
def test_a_mistake_in_the_command_line_is_one_line(
    option: str, value: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["campaign", "small", option, value]) == 2
    assert told in capsys.readouterr().err

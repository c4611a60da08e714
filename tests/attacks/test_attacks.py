"""What one node can do that sees only the bus: nothing lasting, and without the rule about who may say what a lot."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.trials import TrialSettings, run_attack
from bus_sim.cli import main
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.orders import OrderArrivals
from onboard.contract.codes import Reason
from onboard.holon.admission import Admission
from tests.mapd.sites import drawn, site_text

PARK = TrialSettings("small", demand=Arrivals(3, 60.0, 30.0))
PLANS = {name: TrialSettings(name, demand=OrderArrivals(4, 10.0)) for name in ("cell", "graph", "terminal", "turning")}


def play(attack: str, plan: TrialSettings, seed: int = 1) -> list[str]:
    """What was not harmless, in words; nothing where all was."""
    result = run_attack(plan, (attack, seed))
    return [] if result.is_harmless else [f"{result.report.verdict.value}: {result.why()}"]


@pytest.mark.parametrize("attack", ["swap-cars", "stop", "newer-boot"])
def test_a_car_park_gets_over_it(attack: str) -> None:
    assert play(attack, PARK) == []


@pytest.mark.parametrize(
    ("attack", "site"),
    [("claim", "graph"), ("stop", "graph"), ("bit-off", "cell"), ("hold-all", "terminal"), ("other-site", "turning")],
)
def test_other_systems_get_over_it(attack: str, site: str) -> None:
    assert play(attack, PLANS[site]) == []


def test_bids_of_machines_that_have_no_plans_to_tell_count_again_after_a_stop() -> None:
    """Who says OBSTACLE is one; robots of a graph were for ever, as they tell no itinerary, and no call had a bid."""
    assert play("stop", replace(PLANS["graph"], demand=OrderArrivals(12, 17.0), limit_s=900.0), seed=11) == []


def test_arms_that_were_held_in_the_middle_of_a_goal_go_on_with_it() -> None:
    """The first that was let go took the rest of its goal from one still held, which kept its own successor waiting."""
    assert play("stop", replace(PLANS["cell"], demand=OrderArrivals(6, 20.0)), seed=4) == []


def test_a_floor_of_robots_in_step_gets_over_it(tmp_path: Path) -> None:
    site = tmp_path / "made.toml"
    site.write_text(site_text(4, drawn(6, seed=1)))
    for attack in ("grant-away", "stop"):
        assert play(attack, TrialSettings(str(site))) == []


@pytest.mark.parametrize("site", ["graph", "terminal"])
def test_the_attacks_are_real(site: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With everybody's words taken up, not everybody is served in a time in which otherwise everybody is."""
    plan = replace(PLANS[site], limit_s=400.0)
    assert play("hold-all", plan) == []
    monkeypatch.setattr(Admission, "why_not", lambda *_: Reason.NONE)
    assert play("hold-all", plan)


def test_the_command_prints_a_row_for_each_attack(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = tmp_path / "found.json"
    options = ["--attacks", "stop,claim", "--seeds", "1", "--orders", "3", "--jobs", "1", "--json", str(found)]
    assert main(["attack", "graph", *options]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split()[:2] for row in rows if row[:1].islower()][1:] == [["stop", "1/1"], ["claim", "1/1"]]
    assert [one["harmless"] for one in json.loads(found.read_text())["runs"]] == [True, True]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--attacks", "clame"], '--attacks clame: no such attack; did you mean "claim"?'),
        (["--node", "11"], "--node 11: that is"),
        (["--node", "300"], "--node 300: must be from 1 to 255"),
        (["--seeds", "2-1"], "--seeds 2-1: must be a seed"),
        (["--cars", "0"], "--cars 0: must be above 0"),
    ],
)
def test_a_mistake_is_told_in_one_line(options: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["attack", "small", *options]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1


def test_every_attack_says_what_it_does() -> None:
    assert all(entry.summary.endswith(".") and entry.for_s > 0 for entry in ATTACKS.values())

"""What one node can do that sees only the bus: nothing lasting, and without the rule about who may say what a lot."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bus_sim.attacks import watch, words, work
from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.trials import MISSES, STRANGER, AttackVerdict, TrialSettings, run_attack, scenario_of
from bus_sim.cli import main
from bus_sim.faults.injection import Injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.orders import OrderArrivals
from onboard.contract.codes import Reason
from onboard.holon.admission import Admission
from onboard.holon.drops import ToldDrops
from tests.mapd.sites import drawn, site_text

PARK = TrialSettings("small", demand=Arrivals(3, 60.0, 30.0))
PLANS = {name: TrialSettings(name, demand=OrderArrivals(4, 10.0)) for name in ("cell", "graph", "terminal", "turning")}


def play(attack: str, plan: TrialSettings, seed: int = 1) -> list[str]:
    """What was harmful, or not named or back in time, in words; nothing where all was well."""
    result = run_attack(plan, (attack, seed))
    return [f"{result.verdict.value}: {result.why}"] if result.verdict in MISSES else []


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


@pytest.mark.parametrize("seals", ["watch", "required"])
@pytest.mark.parametrize("attack", ["seals-alone", "challenges", "false-answers"])
def test_a_stranger_who_says_nothing_but_seals_is_named_where_there_are_seals(
    attack: str, seals: str, tmp_path: Path
) -> None:
    site, text = tmp_path / "sealed.toml", site_text(2, drawn(2, seed=1))
    site.write_text(text.replace("[site]", f'[site]\nseals = "{seals}"', 1))
    assert play(attack, TrialSettings(str(site), STRANGER)) == []


@pytest.mark.parametrize("site", ["graph", "terminal"])
def test_the_attacks_are_real(site: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With everybody's words taken up, not everybody is served in a time in which otherwise everybody is."""
    plan = replace(PLANS[site], limit_s=400.0)
    assert play("hold-all", plan) == []
    monkeypatch.setattr(Admission, "why_not", lambda *_: Reason.NONE)
    assert play("hold-all", plan)


def test_what_nobody_names_or_gets_over_in_time_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = replace(PLANS["graph"], demand=OrderArrivals(1, 1.0))
    monkeypatch.setattr(ToldDrops, "words", lambda *_: [])
    result = run_attack(plan, ("hold-all", 1))
    assert (result.verdict, result.named, result.back_s) == (AttackVerdict.NOT_NAMED, "", 0.0)
    monkeypatch.setattr(watch, "BACK_US", 5_000_000)
    result = run_attack(plan, ("stop", 1))
    assert (result.verdict, result.named, result.named_s) == (AttackVerdict.LATE_BACK, "EMERGENCY_STOP", 0.0)
    assert result.back_s is not None and result.back_s > 15


def test_an_attacker_that_breaks_down_is_told_and_not_called_harmless(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception in a timer of the plant's, or in who hears a frame, was printed only, and the attack was over."""
    for broken, where in ((words.HoldAll, "words"), (work.CheapestBids, "hear")):
        monkeypatch.setattr(broken, where, lambda *_: 1 // 0)
    for attack in ("hold-all", "bids"):
        result = run_attack(replace(PLANS["graph"], demand=OrderArrivals(1, 1.0)), (attack, 1))
        assert (result.verdict, result.why.split(":")[1]) == (AttackVerdict.HARMFUL, " ZeroDivisionError")


def test_the_command_prints_a_row_for_each_attack_and_goes_on_where_its_file_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found, ledger = tmp_path / "found.json", tmp_path / "all.jsonl"
    options = ["--orders", "3", "--jobs", "1", "--json", str(found), "--add-to", str(ledger)]
    assert main(["attack", "graph", "--attacks", "stop,claim", "--seeds", "1", *options]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split()[:3] for row in rows if row[:1].islower()][1:] == [["claim", "1/1", "1"], ["stop", "1/1", "1"]]
    assert [row.split()[-1] for row in rows if row[:1].islower()][1:] == ["NOT_OF_SITE", "EMERGENCY_STOP"]
    assert [one["harmless"] for one in json.loads(found.read_text())["runs"]] == [True, True]
    kept = ledger.read_text()
    assert main(["attack", "graph", "--attacks", "claim", "--seeds", "1", *options]) == 0
    assert capsys.readouterr().out.splitlines()[-len(rows) :] == rows
    assert ledger.read_text() == kept


def test_the_stranger_has_a_number_that_no_machine_has(tmp_path: Path) -> None:
    """It spoke as the robot, which the site believes, where a robot had the number 240."""
    site, text = tmp_path / "numbers.toml", site_text(2, drawn(2, seed=1))
    assert text.count("node = 11") == 1
    site.write_text(text.replace("node = 11", "node = 240"))
    result = run_attack(TrialSettings(str(site), demand=OrderArrivals(1, 1.0)), ("beats", 1))
    assert (result.verdict, result.node) == (AttackVerdict.WELL, 241)


def test_an_attack_may_begin_while_machines_start() -> None:
    """Without a word it begins once orders come, when everybody has been admitted long ago."""
    plan = replace(PLANS["cell"], demand=OrderArrivals(1, 1.0), begin_s=(0.05, 6.0))
    site = find_site("cell")
    faults = [fault for seed in range(1, 20) for fault in scenario_of(plan, site, "newer-boot", seed).faults]
    begun_s = [fault.number("at_s") for fault in faults if isinstance(fault, Injection)]
    assert min(begun_s) > 0.05 and 5 < max(begun_s) < 6
    assert play("newer-boot", plan) == []


def test_results_of_a_site_file_that_was_changed_do_not_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, ledger, text = tmp_path / "mine.toml", tmp_path / "all.jsonl", site_text(2, drawn(2, seed=1))
    command = ["attack", str(site), "--attacks", "stop", "--seeds", "1", "--orders", "1", "--jobs", "1", "--add-to"]
    for written in (text, text, text.replace("node = 12", "node = 13")):
        site.write_text(written)
        assert main([*command, str(ledger)]) == 0
    assert [json.loads(line)["number"] for line in ledger.read_text().splitlines()] == ["stop 1", "stop 1"]
    assert "1/1 harmless" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--attacks", "clame"], '--attacks clame: no such attack; did you mean "claim"?'),
        (["--node", "11"], "--node 11: that is"),
        (["--node", "240", "--insider"], "--node 240: no machine of small"),
        (["--attacks", "own-number"], "--attacks own-number: speaks under numbers of the site's machines"),
        (["--node", "252"], "--node 252: that is a person's tool, and is believed"),
        (["--node", "300"], "--node 300: must be from 1 to 255"),
        (["--begin", "6-5"], "--begin 6-5: must be two moments in s, the first and the last"),
        (["--begin", "now"], "--begin now: must be two moments in s, the first and the last"),
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

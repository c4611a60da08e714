"""Campaigns on sites that are no car park: orders that a seed draws, and the command that plays all systems alike."""

import json
from pathlib import Path
from typing import Any

import pytest

from bus_sim.campaign.profiles import draw_at_rate, draw_faults, kinds_for
from bus_sim.campaign.report import RunVerdict
from bus_sim.campaign.runner import CampaignSettings, run_seed
from bus_sim.campaign.trial import play
from bus_sim.cli import main
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario, load_scenario
from bus_sim.systems.orders import DRAWN, OrderArrivals, OrderedSystem
from bus_sim.systems.registry import simulated_names, simulated_of
from onboard.core.site import Site
from onboard.systems.registry import system_names
from tests.conformance.cases import CASES
from tests.conformance.runs import site_of

#: To which orders come.
ORDERED = [name for name in CASES if name != "car-park"]


def ordered(site: Site) -> OrderedSystem[Any, Any]:
    """The system of a site to which orders come."""
    system = simulated_of(site)
    assert isinstance(system, OrderedSystem)
    return system


def test_every_system_of_the_boards_can_be_simulated() -> None:
    assert simulated_names() == system_names()


@pytest.mark.parametrize("name", ORDERED)
def test_a_seed_draws_orders_of_its_own_and_they_are_carried_out(name: str) -> None:
    site = site_of(name)
    system = ordered(site)
    orders = OrderArrivals(3, system.most(site).apart_s)
    drawn = [system.with_orders(site, orders, seed) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]
    assert system.with_orders(site, OrderArrivals(0, 1.0), 1) is site
    report = play(site, FaultScenario(site.name, 1, 4 * 3_600.0, demand=orders))
    assert report.verdict is RunVerdict.SERVED, report.why()
    assert report.served >= 3 and report.waiting == 0
    assert report.simulated_s < 3 * system.span_s(drawn[0])[1]


@pytest.mark.parametrize("name", ORDERED)
def test_faults_strike_while_orders_are_carried_out(name: str) -> None:
    system = ordered(site_of(name))
    site = system.with_orders(site_of(name), OrderArrivals(4, 30.0), 1)
    first_s, last_s = system.span_s(site)
    for profile in ("bus", "crash", "all"):
        assert kinds_for(profile, site).keys() <= DRAWN
        faults = [fault for seed in range(30) for fault in draw_faults(profile, seed, site, (first_s, last_s))]
        assert all(first_s <= fault.number("at_s") <= last_s for fault in faults)
    assert kinds_for("people", site) == {}
    assert draw_at_rate("all", 1, site, 60, 36_000)


def test_the_command_plays_a_graph_and_tells_of_orders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = tmp_path / "figures.json"
    command = ["campaign", "graph", "--seeds", "1-2", "--jobs", "1", "--orders", "3", "--out", str(tmp_path / "out")]
    assert main([*command, "--json", str(figures)]) == 0
    told = capsys.readouterr().out
    assert "campaign on graph: seeds 1-2, faults all, 3 orders each" in told
    assert "6 orders: served 6, told why 0, left waiting 0\n" in told
    runs = json.loads(figures.read_text(encoding="utf-8"))["runs"]
    assert [run["served"] for run in runs] == [3, 3] and all(run["faults"] for run in runs)


def test_orders_of_the_site_itself_are_played_where_none_are_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["campaign", "graph", "--seeds", "5", "--faults", "none", "--jobs", "1", "--out", str(tmp_path)]
    assert main([*command, "--orders", "0"]) == 0
    told = capsys.readouterr().out
    assert "the site's own orders each" in told and "8 orders: served 8" in told


def test_a_failure_is_shrunk_kept_and_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    faults = tuple(
        parse_injection(text)
        for text in ("burst:at_s=14", "crash:target=OD,at_s=16,restart=no", "drift:target=R1,at_s=9")
    )
    monkeypatch.setattr("bus_sim.campaign.runner.draw_faults", lambda *_: faults)
    result = run_seed(CampaignSettings("graph", "all", 120.0, out=tmp_path, demand=OrderArrivals(2, 5.0)), 3)
    assert result.report.verdict is RunVerdict.NOT_SERVED
    kept, site = load_scenario(tmp_path / "graph-all-3.toml")
    assert kept == result.shrunk and kept.faults == faults[1:2] and kept.demand == OrderArrivals(2, 5.0)
    assert play(site, kept).waiting == result.report.waiting
    trace = tmp_path / "again.log"
    assert main(["run", "--scenario", str(tmp_path / "graph-all-3.toml"), "--trace", str(trace)]) == 1
    assert "outcome      not served" in capsys.readouterr().out
    assert trace.read_bytes() == (tmp_path / "graph-all-3.log").read_bytes() != b""


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("graph", "--cars", "3"), "--cars 3: graph is a factory graph, to which no cars come; write --orders"),
        (("graph", "--faults", "people"), "--faults people: graph is a factory graph"),
        (("graph", "--orders", "-1"), "--orders -1: must be from 0"),
        (("terminal", "--orders", "40"), "--orders 40: terminal has boxes for 11 missions at most"),
        (("small", "--orders", "3"), "--orders 3: small is a car park; write --cars"),
    ],
)
def test_a_mistake_is_one_line(arguments: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", *arguments]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1


@pytest.mark.parametrize(
    ("site", "text", "told"),
    [
        (
            "graph",
            "[demand]\ncars = 3\n",
            ":5: demand: is nothing for a factory graph; write [orders], or leave it out",
        ),
        ("small", "[orders]\ncount = 3\n", ":5: orders: is nothing for a car park; write [demand], or leave it out"),
        ("graph", "[orders]\napart_s = 3\n", ":5: orders.count: is missing; write count = 12, or 0"),
        (
            "graph",
            "[orders]\ncount = -3\n",
            ":5: orders.count = -3: has the wrong value; must be a whole number from 0",
        ),
        (
            "graph",
            '[[fault]]\nkind = "lost_ticket"\ncar = 1\n',
            "a factory graph has nothing that this strikes (a customer comes back",
        ),
    ],
)
def test_a_mistake_in_a_scenario_is_one_line(
    site: str, text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(f'[scenario]\nsite = "{site}"\nseed = 1\n\n{text}', encoding="utf-8")
    assert main(["run", "--scenario", str(path)]) == 2
    assert told in capsys.readouterr().err

"""A machine that bids and does nothing starves nobody, on any system that calls: served, or told why."""

import re

import pytest

from bus_sim.campaign.strangers import StrangerPlan, play_pair
from bus_sim.cli import main
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.orders import OrderArrivals
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stranger import Stranger
from tests.conformance.cases import CASES
from tests.conformance.runs import site_file, site_of
from tests.thinned import some

BESIDE = [(case.system, how, case.orders) for case in CASES.values() if case.orders is not None for how in Stranger]
#: Nobody there bids by the core's calls.
WITHOUT = [name for name in CASES if simulated_of(site_of(name)).worker is None]


@pytest.mark.parametrize(("system", "how", "orders"), some(BESIDE, 6))
def test_orders_are_served_or_told_why_beside_a_stranger(system: str, how: Stranger, orders: OrderArrivals) -> None:
    limit_s = simulated_of(site_of(system)).patience_s(site_of(system), orders, 1)
    pair = play_pair(StrangerPlan(site_file(system), how, orders, limit_s), 1)
    assert pair.is_good, pair.line()
    assert pair.strange.served, "not all of them refused"


def test_two_desks_that_want_one_box_get_two() -> None:
    """Who had won it for one desk dropped it as the other called for it, and one mission got a box too few."""
    site = find_site("terminal")
    system = simulated_of(site)
    orders = system.usual(site, {})
    limit_s = system.patience_s(site, orders, 5)
    pair = play_pair(StrangerPlan("terminal", Stranger.LIAR, orders, limit_s), 5)
    assert pair.is_good, pair.line()


def test_a_car_whose_custodian_waits_for_no_silent_winner_is_called_for_anew_by_its_own_compartment() -> None:
    """Its initiator, which is not the custodian, said the award for two hours: three of twelve cars stayed inside."""
    plan = StrangerPlan("standard", Stranger.SILENT, Arrivals(12, 30.0, 10.0, 200.0), 1_500.0)
    pair = play_pair(plan, 50426)
    assert (pair.strange.served, pair.strange.broken) == (12, ()), pair.line()


def test_nobody_plans_to_stand_where_a_stranger_stands_that_has_told_no_way() -> None:
    """Its plan had no leg: another planned to end there, waited for ten minutes, and was given no task for good."""
    pair = play_pair(StrangerPlan("standard", Stranger.SILENT, Arrivals(12, 60.0, 30.0), 3_600.0), 50452)
    assert (pair.strange.served, pair.strange.broken) == (12, ()), pair.line()
    assert pair.is_good, pair.line()


def test_a_robot_that_bids_less_than_it_can_does_not_win_what_others_do_sooner() -> None:
    """It did what it won, one after the other, while the others stood: 12 cars waited two minutes longer."""
    pair = play_pair(StrangerPlan("standard", Stranger.LIAR, Arrivals(12, 45.0, 22.5), 3_600.0), 50461)
    assert (pair.strange.served, pair.strange.broken) == (12, ()), pair.line()
    assert pair.is_good, pair.line()


def test_a_car_that_drives_in_is_called_for_anew_as_soon_as_its_winner_is_silent() -> None:
    """So long it was nobody's, its compartment waited: 16 s each time, and all waited 40 s longer."""
    pair = play_pair(StrangerPlan("small", Stranger.SILENT, Arrivals(12, 30.0, 15.0), 3_600.0), 50504)
    assert pair.is_good, pair.line()


@pytest.mark.parametrize("system", WITHOUT)
def test_a_site_on_which_nobody_can_be_a_stranger_says_so(system: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", site_file(system), "--stranger", "stands", "--seeds", "1-1"]) == 2
    assert "where no machine bids by the calls of all" in capsys.readouterr().err


def test_a_site_on_which_nobody_else_could_do_the_work_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", "crescent", "--stranger", "silent", "--seeds", "1-1"]) == 2
    told = capsys.readouterr().err
    assert "crescent has one robot" in told
    assert "take a site with two" in told


def test_the_table_of_a_campaign_with_a_stranger_is_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    """It said "served 12 of 9", where nine were served without the machine, and "with a machine that liar"."""
    assert main(["campaign", "graph", "--stranger", "liar", "--seeds", "1-1", "--jobs", "1"]) == 0
    of_the_seed, of_all = capsys.readouterr().out.splitlines()
    assert re.match(r"seed 1: served \d+ \(\d+ without it\), told why 0, waiting 0, mean wait ", of_the_seed)
    assert of_all.startswith("1 seed with a machine that lies: 0 failed; ")

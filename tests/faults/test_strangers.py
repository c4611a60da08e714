"""A machine that bids and does nothing starves nobody, on any system that calls: served, or told why."""

from pathlib import Path

import pytest

from bus_sim.campaign.strangers import StrangerPlan, play_pair
from bus_sim.cli import main
from bus_sim.sites import find_site
from bus_sim.systems.orders import OrderArrivals
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stranger import Stranger
from tests.mapd.sites import site_text

ORDERS = {
    "graph": OrderArrivals(3, 20.0),
    "terminal": OrderArrivals(2, 30.0),
    "cell": OrderArrivals(3, 20.0),
    "turning": OrderArrivals(2, 30.0),
}


@pytest.mark.parametrize("how", list(Stranger))
@pytest.mark.parametrize("name", list(ORDERS))
def test_orders_are_served_or_told_why_beside_a_stranger(name: str, how: Stranger) -> None:
    site = find_site(name)
    limit_s = simulated_of(site).patience_s(site, ORDERS[name], 1)
    pair = play_pair(StrangerPlan(name, how, ORDERS[name], limit_s), 1)
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


def test_a_site_without_calls_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "made.toml"
    path.write_text(site_text(2, [(0, "1,2", "3,5")]), encoding="utf-8")
    assert main(["campaign", str(path), "--stranger", "stands", "--seeds", "1-1"]) == 2
    assert "where no machine bids by the calls of all" in capsys.readouterr().err

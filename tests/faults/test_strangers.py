"""A machine that bids and does nothing starves nobody, on any system that calls: served, or told why."""

from pathlib import Path

import pytest

from bus_sim.campaign.strangers import StrangerPlan, play_pair
from bus_sim.campaign.systems import patience_s, usual_orders, with_orders
from bus_sim.cli import main
from bus_sim.faults.scenario import Arrivals
from bus_sim.sites import find_site
from bus_sim.stranger import Stranger
from bus_sim.systems.orders import Orders
from tests.mapd.sites import site_text

ORDERS = {"graph": Orders(3, 20.0), "terminal": Orders(2, 30.0), "cell": Orders(3, 20.0), "turning": Orders(2, 30.0)}


@pytest.mark.parametrize("how", list(Stranger))
@pytest.mark.parametrize("name", list(ORDERS))
def test_orders_are_served_or_told_why_beside_a_stranger(name: str, how: Stranger) -> None:
    site = find_site(name)
    limit_s = patience_s(with_orders(site, ORDERS[name], 1))
    pair = play_pair(StrangerPlan(name, how, Arrivals(1, 1.0, 0.0), limit_s, ORDERS[name]), 1)
    assert pair.is_good, pair.line()
    assert pair.strange.served, "not all of them refused"


def test_two_desks_that_want_one_box_get_two() -> None:
    """Who had won it for one desk dropped it as the other called for it, and one mission got a box too few."""
    site = find_site("terminal")
    orders = usual_orders(site, None, None)
    limit_s = patience_s(with_orders(site, orders, 5))
    pair = play_pair(StrangerPlan("terminal", Stranger.LIAR, Arrivals(1, 1.0, 0.0), limit_s, orders), 5)
    assert pair.is_good, pair.line()


def test_a_site_without_calls_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "made.toml"
    path.write_text(site_text(2, [(0, "1,2", "3,5")]), encoding="utf-8")
    assert main(["campaign", str(path), "--stranger", "stands", "--seeds", "1-1"]) == 2
    assert "use a car park or one of graph, terminal, cell, turning" in capsys.readouterr().err

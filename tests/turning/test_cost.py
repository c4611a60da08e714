"""The five terms of a lathe's bid (rows P24, P26, P27)."""

from dataclasses import replace

import pytest

from onboard.systems.turning.cost import ToolEdgeUse, bill
from onboard.systems.turning.lathe import LatheState
from onboard.systems.turning.process import generate, wear_of
from tests.turning.workshop import JOB, SHAFT, STEEL, lathe


def test_p26_the_hand_computed_part() -> None:
    """60 EUR/h, 3.2 min of cutting, an 8 EUR edge of 20 min, 15 min of setup for 10 parts, 4.10 EUR of bar, 0.5 min."""
    one = bill(60.0, 3.2, (ToolEdgeUse(8.0, 3.2, 20.0),), 15.0, 10, 4.10, 0.5)
    assert [round(term, 2) for term in one] == [3.20, 1.28, 1.50, 4.10, 0.50]
    assert one.total_eur == pytest.approx(10.58)
    assert one.total_cents == 1058


def test_p26_the_five_terms_sum_to_the_bid() -> None:
    process = generate(JOB, SHAFT, STEEL, lathe(1, 60.0), LatheState())
    assert process is not None
    assert process.bill.total_eur == pytest.approx(sum(process.bill))
    assert process.bill.machining_eur == pytest.approx(process.machining_min)
    assert process.bill.setup_eur == pytest.approx(1.5)
    assert process.bill.latency_eur == pytest.approx(0.5)
    # 45 mm bar, 60 + 1 + 5 mm and 20 mm in the jaws, 7.85 kg/dm3 at 1.60 EUR/kg.
    assert process.bill.material_eur == pytest.approx(3.14159265 / 4 * 0.45**2 * 0.86 * 7.85 * 1.6)
    assert all(term > 0 for term in process.bill)


def test_p24_a_worn_tool_changes_the_bid() -> None:
    job = replace(JOB, batch=4)
    fresh = generate(job, SHAFT, STEEL, lathe(1, 60.0), LatheState())
    worn = generate(job, SHAFT, STEEL, lathe(1, 60.0), LatheState(used_min={1: 19.9}))
    assert fresh is not None and worn is not None
    assert (worn.wear[1].changes, fresh.wear[1].changes, worn.wear[2].changes) == (1, 0, 0)
    # Two minutes of standing for the batch, and what the edge was still worth.
    assert worn.bill.setup_eur - fresh.bill.setup_eur == pytest.approx(60.0 * 2 / 60 / 4)
    assert worn.bill.tools_eur - fresh.bill.tools_eur == pytest.approx(8.0 * 0.1 / 20 / 4)
    assert worn.bill.total_cents > fresh.bill.total_cents


def test_p24_an_edge_is_changed_before_a_part_that_it_would_not_last_for() -> None:
    assert wear_of(5.0, 20.0, 3.0, 1) == (0, 0.0, 2.0)
    # One part with 5 minutes left, then six with a new edge (2 minutes thrown away), then another edge.
    assert wear_of(5.0, 20.0, 3.0, 8) == (2, 4.0, 17.0)
    assert wear_of(0.0, 2.0, 3.0, 1) is None


def test_p24_a_lathe_that_is_set_up_already_pays_no_setup() -> None:
    ready = LatheState(set_up_for=(SHAFT.number, "three jaws"))
    process = generate(JOB, SHAFT, STEEL, lathe(1, 60.0), ready)
    assert process is not None and process.bill.setup_eur == 0


def test_p27_cost_compares_three_lathes() -> None:
    lathes = [lathe(1, 90.0), lathe(2, 60.0), lathe(3, 55.0, setup_min=40.0)]
    bids = {}
    for one in lathes:
        process = generate(JOB, SHAFT, STEEL, one, LatheState())
        assert process is not None
        bids[one.node_id] = process.bill.total_cents
    assert min(bids, key=bids.__getitem__) == 2

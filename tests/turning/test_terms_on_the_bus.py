"""Rows P24 and P26, read from the bus: what changes a lathe's bid, and what its five terms are made of."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import pi
from typing import Any

import pytest

from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.turning.nc import run_program
from bus_sim.systems.turning.plant import TurningPlant
from onboard.contract.messages import Award, Bid, Message
from onboard.contract.turning import BillBar, BillCutting, BillWaiting, LathePhase, LatheProgress, TurningOrder
from onboard.systems.turning.lathe import TurningJob
from onboard.systems.turning.site import BatchDemand, Turning
from tests.cut import Timed, first_of, shown, shown_at

#: The lathe of middle size, at 60 EUR an hour: a cent for each 0.6 s. Its edges: 8 EUR for 20 min, 6 EUR for 15 min.
L2, CENTS_A_S = 2, 60 * 100 / 3600
#: An edge change takes so long, s.
CHANGE_S = 120


def _site(*orders: BatchDemand) -> Turning:
    site = find_site("turning")
    assert isinstance(site, Turning)
    return replace(site, orders=orders or site.orders)


def test_p26_the_five_terms_on_the_bus_are_what_the_work_takes() -> None:
    """Four shafts of a bar of 45 mm on L2: its terms against its own progress, its program, and the bar worked out."""
    order = BatchDemand(0, TurningJob(2, 1, 45, 4))
    played = play(_site(order), RunOptions(limit_s=1_100))
    assert isinstance(played.plant, TurningPlant)
    cut_min = run_program(played.plant.programs[L2, 2]).cut_min

    def check(said: Sequence[Timed]) -> None:
        first = partial(first_of, said)
        cutting, waiting = first(BillCutting, lambda one: one.sender == L2)[1], first(BillWaiting, _is_l2)[1]
        bar, bid = first(BillBar, _is_l2)[1], first(Bid, _is_l2)[1]
        setting_us = first(LatheProgress, lambda one: one.lathe_phase is LathePhase.SETTING_UP)[0]
        turning_us = first(LatheProgress, lambda one: one.lathe_phase is LathePhase.TURNING)[0]
        made_us = first(LatheProgress, lambda one: one.made == 1)[0]
        # Setup is shared by four; one part is loaded and unloaded in half a minute, and machined in what is left.
        assert waiting.setup_ct == pytest.approx((turning_us - setting_us) / 1e6 * CENTS_A_S / 4, abs=1)
        assert waiting.latency_ct == 30 * CENTS_A_S
        assert cutting.machining_ct == pytest.approx(((made_us - turning_us) / 1e6 - 30) * CENTS_A_S, abs=2)
        assert cutting.tools_ct == round(100 * (8 * cut_min[1] / 20 + 6 * cut_min[2] / 15))
        # 60 mm of shaft, 1 mm at the face, 5 mm to part it off, 20 mm in the jaws; 7.85 kg/dm3 at 1.60 EUR/kg.
        assert bar.material_ct == round(100 * pi / 4 * 0.45**2 * 0.86 * 7.85 * 1.6)
        assert cutting.machining_ct + cutting.tools_ct + waiting.setup_ct + waiting.latency_ct + bar.material_ct == (
            bar.total_ct
        )
        assert bid.cost == bar.total_ct

    shown_at(check, played.messages, BillCutting, BillWaiting, BillBar, Bid, LatheProgress)


def _is_l2(message: Message) -> bool:
    return message.sender == L2


# --- what changes it -------------------------------------------------------------------------------------------------

#: Machining, tools, setup, latency, bar and the sum, ct.
Terms = tuple[int, int, int, int, int, int]


def _bids(site: Turning, used_min: float = 0.0) -> list[Message]:
    """What is said until the order of a site is awarded, where L2's roughing edge has cut for so many minutes."""

    def worn(run: BusRun[Any]) -> None:
        assert isinstance(run.plant, TurningPlant)
        run.plant.devices[L2].used_min[1] = used_min

    return [one for _, one in play(site, RunOptions(limit_s=12), prepare=worn).messages]


def _terms(said: Sequence[Message], bar_mm: int) -> Terms:
    """L2's, as told before its bid for an order of such a bar."""
    timed = [(0, one) for one in said]
    assert first_of(timed, TurningOrder)[1].bar_mm == bar_mm
    cutting, waiting = first_of(timed, BillCutting, _is_l2)[1], first_of(timed, BillWaiting, _is_l2)[1]
    bar = first_of(timed, BillBar, _is_l2)[1]
    assert first_of(timed, Bid, _is_l2)[1].cost == bar.total_ct
    return (
        cutting.machining_ct,
        cutting.tools_ct,
        waiting.setup_ct,
        waiting.latency_ct,
        bar.material_ct,
        bar.total_ct,
    )


def test_p24_drawing_and_bar_lathe_and_worn_edge_change_the_bid_on_the_bus() -> None:
    """Of four bids for a shaft: each term that an input has to do with is another, and every other the same."""
    order = BatchDemand(0, TurningJob(2, 1, 45, 1))
    site = _site(order)
    usual = _terms(_bids(site), 45)

    def compared(bar_mm: int, check: Callable[[Terms], None]) -> Callable[[Sequence[Message]], None]:
        return lambda said: check(_terms(said, bar_mm))

    def with_a_thicker_bar(terms: Terms) -> None:
        assert terms[4] > usual[4] and terms[0] > usual[0], "there is more to cut off, and more to buy"
        assert terms[2:4] == usual[2:4]

    def on_a_cheaper_lathe(terms: Terms) -> None:
        assert [terms[0], terms[2], terms[3]] == pytest.approx([usual[0] / 2, usual[2] / 2, usual[3] / 2], abs=1)
        assert (terms[1], terms[4]) == (usual[1], usual[4])

    def with_a_worn_edge(terms: Terms) -> None:
        # It is changed, which takes two minutes, and the rest of it, 0.05 of 20 min, is thrown away.
        assert terms[2] - usual[2] == round(CHANGE_S * CENTS_A_S)
        assert terms[1] - usual[1] == pytest.approx(100 * 8 * 0.05 / 20, abs=1)
        assert (terms[0], *terms[3:5]) == (usual[0], *usual[3:5])

    cheap = replace(site, lathes={**site.lathes, L2: replace(site.lathes[L2], hourly_eur=30.0)})
    thick = replace(site, orders=(BatchDemand(0, TurningJob(2, 1, 60, 1)),))
    kinds = (TurningOrder, BillCutting, BillWaiting, BillBar, Bid)
    shown(compared(60, with_a_thicker_bar), _bids(thick), *kinds)
    shown(compared(45, on_a_cheaper_lathe), _bids(cheap), *kinds)
    shown(compared(45, with_a_worn_edge), _bids(site, 19.95), *kinds)

    # Beside an L1 that costs almost the same the edge decides.
    close = replace(site, lathes={**site.lathes, 1: replace(site.lathes[1], hourly_eur=49.0)})
    awards = [first_of([(0, one) for one in _bids(close, used_min)], Award)[1] for used_min in (0, 19.95)]
    assert [one.winner for one in awards] == [L2, 1]

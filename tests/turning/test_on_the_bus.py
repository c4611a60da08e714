"""Three lathes over CAN: bids in money, a known winner, its program run by the control (rows P21, P24 to P27, P59)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site, site_text
from bus_sim.systems.stage import SystemStage
from bus_sim.systems.turning.nc import ProgramError, run_program
from bus_sim.systems.turning.plant import TurningPlant
from bus_sim.systems.turning.show import board
from onboard.config.site import parse_site
from onboard.contract.codes import Criterion, KindCode, Operation, OrderResult
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, CallForProposals
from onboard.contract.turning import BillBar, LathePhase, LatheProgress, TurningOrder
from onboard.holon.holon import Holon
from onboard.systems.turning.checks import RULES
from onboard.systems.turning.generation import LatheGeneration
from onboard.systems.turning.lathe import LatheState, TurningJob
from onboard.systems.turning.machine import LatheMachine
from onboard.systems.turning.process import generate
from onboard.systems.turning.site import BatchDemand, Turning
from tests.faults.systems import judged


def _site(*orders: BatchDemand) -> Turning:
    site = find_site("turning")
    assert isinstance(site, Turning)
    return replace(site, orders=orders or site.orders)


def _play(site: Turning, prepare: Callable[[BusRun[Any]], None] | None = None, **options: object) -> SystemStage[Any]:
    return play(site, RunOptions(limit_s=20_000, **options), prepare=prepare)  # type: ignore[arg-type]  # as given


def _plant(played: SystemStage[Any]) -> TurningPlant:
    assert isinstance(played.plant, TurningPlant)
    return played.plant


def _sound(played: SystemStage[Any]) -> None:
    assert played.plant.violations == [] and played.halted == [] and played.is_over


@pytest.fixture(scope="module")
def shipped() -> SystemStage[Any]:
    """The shipped site, once."""
    return _play(_site())


def test_p27_three_lathes_and_the_winner_that_is_known(shipped: SystemStage[Any]) -> None:
    """The cheapest by the five terms worked out here wins: thin pins L3, the shaft L2, only L1 holds the flange."""
    _sound(shipped)
    site = _site()
    entries = _plant(shipped).entries
    assert [(entry.winner, entry.result) for entry in entries] == [(node, OrderResult.DONE) for node in (3, 2, 1, 3)]
    calls = {one.task.number: one for _, one in shipped.messages if isinstance(one, CallForProposals)}
    assert {(one.operation, one.kind, one.criterion) for one in calls.values()} == {
        (Operation.MACHINE, KindCode.LATHE, Criterion.MONEY)
    }
    for number in (1, 2, 3):
        job = site.orders[number - 1].job
        made = {
            node: generate(job, site.drawings[job.drawing], site.materials[job.material], lathe, LatheState())
            for node, lathe in site.lathes.items()
        }
        cents = {node: one.bill.total_cents for node, one in made.items() if one is not None}
        assert min(cents, key=cents.__getitem__) == entries[number - 1].winner
        assert entries[number - 1].total_ct == min(cents.values())


def test_p25_the_control_runs_the_winners_program_and_the_part_is_as_drawn(shipped: SystemStage[Any]) -> None:
    plant = _plant(shipped)
    assert set(plant.programs) == {(3, 1), (2, 2), (1, 3)}
    assert set(plant.errors_mm) == {1, 2, 3} and max(plant.errors_mm.values()) <= 0.01
    assert [device.made for device in plant.devices.values()] == [{3: 1}, {2: 4}, {1: 11}]
    phases = [one.lathe_phase for _, one in shipped.messages if isinstance(one, LatheProgress) and one.sender == 2]
    assert list(dict.fromkeys(phases)) == list(LathePhase)
    assert run_program(plant.programs[2, 2]).tool_changes == 3
    with pytest.raises(ProgramError, match="no M30"):
        run_program(plant.programs[2, 2].replace("M30", "M0"))


def test_p26_the_five_terms_are_on_the_bus_and_sum_to_the_bid(shipped: SystemStage[Any]) -> None:
    verdict = judged(_site(), shipped.messages)
    assert verdict.is_good, verdict.lines()
    assert all(verdict.seen[rule.name] for rule in RULES)
    bids = [one for _, one in shipped.messages if isinstance(one, Bid)]
    bars = [one for _, one in shipped.messages if isinstance(one, BillBar)]
    assert [(one.sender, one.total_ct) for one in bars] == [(one.sender, one.cost) for one in bids]


def test_p24_a_worn_edge_changes_the_bid_and_here_the_winner() -> None:
    """The sensor of L2's roughing edge decides between it and an L1 that is almost as cheap."""
    site = _site(BatchDemand(0, TurningJob(2, 1, 45, 1)))
    site = replace(site, lathes={**site.lathes, 1: replace(site.lathes[1], hourly_eur=49.0)})

    def worn(run: BusRun[Any]) -> None:
        assert isinstance(run.plant, TurningPlant)
        run.plant.devices[2].used_min[1] = 19.95

    winners = []
    for prepare in (None, worn):
        played = _play(site, prepare)
        _sound(played)
        winners.append(_plant(played).entries[0].winner)
    assert winners == [2, 1]


def test_p24_edges_are_changed_before_they_are_worn_out() -> None:
    played = _play(_site(BatchDemand(0, TurningJob(2, 1, 45, 60))))
    _sound(played)
    plant = _plant(played)
    assert plant.entries[0].result is OrderResult.DONE and sum(one.edges_changed for one in plant.devices.values()) >= 1


def test_p21_a_lathe_looks_at_no_other_machine(shipped: SystemStage[Any]) -> None:
    """What the others do, and the mirror of it, changes nothing: a lathe alone bids what it bid beside the others."""
    site = _site()
    alone = LatheGeneration(site, site.machines[3])
    order = next(one for _, one in shipped.messages if isinstance(one, TurningOrder))
    call = next(one for _, one in shipped.messages if isinstance(one, CallForProposals))
    alone.hear(order)
    bid = next(one for _, one in shipped.messages if isinstance(one, Bid) and one.sender == 3)
    assert alone.lower_bound(call, 0) == alone.lower_bound(call, 10**9) == bid.cost
    found = alone.estimate(call, 0)
    assert found is not None and found.cost == bid.cost and found.itinerary is None


def test_p59_the_same_holon_drives_lathes(shipped: SystemStage[Any]) -> None:
    controllers = shipped.run.controllers
    assert {type(one.holon) for one in controllers.values()} == {Holon}
    assert {type(one.holon.behaviour) for node, one in controllers.items() if node != 9} == {LatheMachine}
    assert "order 2: 4 x shaft: DONE L2" in board(_plant(shipped))


def test_a05_the_last_number_of_a_program_is_loaded_and_run_as_any_other() -> None:
    """Programs have numbers from 1 to 255; the first task of a desk at node 148 has the last."""
    text = site_text("turning").replace("node = 9\n", "node = 148\n")
    site = parse_site(text, "turning.toml")
    assert isinstance(site, Turning)
    played = _play(replace(site, orders=(BatchDemand(0, TurningJob(2, 1, 45, 1)),)))
    _sound(played)
    assert [entry.result for entry in _plant(played).entries] == [OrderResult.DONE]
    assert 255 in {lathe.program for lathe in _plant(played).devices.values()}


def test_what_no_lathe_can_make_is_refused() -> None:
    # A bar of 300 mm is in nobody's jaws.
    played = _play(_site(BatchDemand(0, TurningJob(3, 1, 300, 1))))
    _sound(played)
    assert [one.result for one in _plant(played).entries] == [OrderResult.REFUSED]
    assert not any(isinstance(one, Bid) for _, one in played.messages)


def test_what_a_lathe_has_begun_while_it_was_not_heard_is_its_own() -> None:
    """The desk takes the second order back from who is silent; the lathe begins it before anybody hears it again."""
    pins = TurningJob(1, 2, 14, 1)
    site = _site(BatchDemand(0, pins), BatchDemand(5_000, replace(pins, batch=2)))
    begun_s = next(
        time_us / 1e6
        for time_us, one in _play(site).messages
        if isinstance(one, LatheProgress) and (one.task, one.lathe_phase) == (2, LathePhase.SETTING_UP)
    )
    cut = f"partition:members=L3,at_s={begun_s - 15:.3f},for_s=20"
    played = _play(site, faults=(parse_injection(cut),))
    _sound(played)
    assert [(entry.winner, entry.result) for entry in _plant(played).entries] == [(3, OrderResult.DONE)] * 2
    taken_back = [one.task.number for _, one in played.messages if isinstance(one, Award) and one.winner == NOBODY]
    assert 2 in taken_back, "else this shows nothing"
    assert [device.made for device in _plant(played).devices.values()][2] == {1: 3}

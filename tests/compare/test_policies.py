"""P56: the joint choice is a strong opponent, and nobody beats a bound. Waiting is what customers saw."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.compare.plays import MIP, POLICIES, Play, play
from bus_sim.systems.car_park.compare.policies import AnyFirst, JointChoice, NearestFirst
from bus_sim.systems.car_park.compare.table import tabulate
from bus_sim.systems.car_park.demand import Demand
from onboard.config.site import parse_site
from onboard.systems.car_park.site import DeskPolicy, car_park
from tests.sites import at_the_key
from tests.thinned import is_long

SITE = at_the_key(find_site("small"))
#: One car a minute in and one out: the compartment of this site serves fewer, so queues grow.
SEEDS = (1, 2, 3) if is_long() else (1,)
CARS, APART_S = (8, 60.0) if is_long() else (5, 40.0)


def demand(seed: int) -> Demand:
    return Demand.by_mean(APART_S, APART_S / 2, seed, count=CARS)


@cache
def played(policy: str, seed: int) -> Play:
    return play(SITE, demand(seed), policy, seed)


def waits_us(policy: str, seeds: Sequence[int] = SEEDS) -> list[int]:
    return [us for seed in seeds for us in played(policy, seed).in_us + played(policy, seed).out_us]


def mean_s(policy: str) -> float:
    waits = waits_us(policy)
    return sum(waits) / len(waits) / 1e6


@pytest.mark.parametrize("policy", POLICIES)
def test_p56_every_policy_serves_everybody_without_a_fault(policy: str) -> None:
    for seed in SEEDS:
        one = played(policy, seed)
        assert (one.left, one.faults) == (0, ())
        assert (len(one.in_us), len(one.out_us), one.tasks) == (CARS, CARS, 2 * CARS)


def test_p56_robots_on_batteries_are_sent_as_well() -> None:
    """What a dispatcher looked ahead with had never seen a gauge, and nobody was served."""
    text = (files("bus_sim") / "sites" / "small.toml").read_text(encoding="utf-8")
    site = car_park(parse_site(f"{text}\n[battery]\ncapacity_wh = 800\n", "small.toml"))
    one = play(site, Demand.by_mean(40.0, 20.0, 1, count=2), JointChoice.name, 1)
    assert (one.left, one.faults, one.tasks) == (0, (), 4)


def test_p56_the_joint_choice_beats_nearest_first_and_random() -> None:
    joint_s = mean_s(JointChoice.name)
    assert joint_s < 0.99 * mean_s(NearestFirst.name)
    assert joint_s < 0.97 * mean_s(AnyFirst.name)


def test_p56_the_joint_choice_is_far_better_where_there_is_more_to_choose() -> None:
    """Three compartments, four robots, cars asked for at any desk: the others took 1.3 times as long over ten seeds.

    Where a car comes to the compartment beside it, as the shipped site has it, there is less to choose.
    """
    site = replace(at_the_key(find_site("standard")), desk=DeskPolicy.ANY)
    seeds, cars, apart_s = ((1, 3), 8, 30.0) if is_long() else ((1,), 5, 20.0)

    def mean_of(policy: str) -> float:
        plays = [play(site, Demand.by_mean(apart_s, apart_s / 2, seed, count=cars), policy, seed) for seed in seeds]
        assert [(one.left, one.faults) for one in plays] == [(0, ())] * len(seeds)
        waits = [us for one in plays for us in one.in_us + one.out_us]
        return sum(waits) / len(waits)

    joint = mean_of(JointChoice.name)
    assert joint < 0.9 * mean_of(NearestFirst.name)
    assert joint < 0.9 * mean_of(AnyFirst.name)


def test_p56_the_price_of_being_decentralised_is_small() -> None:
    # Measured: 1.03 over these seeds.
    assert 0.97 < mean_s(MIP) / mean_s(JointChoice.name) < 1.10


@pytest.mark.parametrize("policy", POLICIES)
def test_p56_nobody_beats_a_bound(policy: str) -> None:
    for seed in SEEDS:
        one = played(policy, seed)
        assert one.bounds.visits == 2 * CARS
        assert one.bounds.waited_s == pytest.approx(sum(one.in_us + one.out_us) / 2e6 / CARS)
        assert one.bounds.to_bays_alone >= 1
        assert one.bounds.to_free_flow >= 1


def test_a_play_is_the_same_each_time() -> None:
    again = play(SITE, demand(1), AnyFirst.name, 1)
    assert again == played(AnyFirst.name, 1)


def test_central_robots_bid_for_no_task() -> None:
    """With a dispatcher calls, awards and rides are there, and bids only of lifts."""
    mip, joint = played(MIP, 1), played(JointChoice.name, 1)
    assert joint.messages < mip.messages + joint.tasks


def test_a_run_that_left_somebody_waiting_counts_for_no_policy() -> None:
    good = [played(policy, 1) for policy in (MIP, JointChoice.name)]
    stuck = Play(MIP, 2, (), (), 60.0, 0, 0, 0, 0.0, 3, ())
    fine = Play(JointChoice.name, 2, (1_000_000,), (), 60.0, 1, 10, 5, 9.0, 0, ())
    table = tabulate("a site", [*good, stuck, fine])
    assert [row.policy for row in table.rows] == [MIP, JointChoice.name]
    assert table.rows[1].wait_in.count == CARS
    assert table.left_out == (f"seed 2, under {MIP} 3 customers were not served",)
    assert "left out: seed 2" in "\n".join(table.lines())
    mine, joint = (row.bounds for row in table.rows)
    ratio = f"{mine.waited_s:.1f} | {mine.waited_s / joint.waited_s:.2f} | {mine.bays_alone_s:.1f}: "
    assert ratio + f"{mine.to_bays_alone:.2f} |" in "\n".join(table.lines())

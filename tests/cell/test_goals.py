"""Several goals, deadlines, joining robots, goals that cannot be achieved, faults (rows C02, C15 to C17, C19)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from bus_sim.run import BusRun
from bus_sim.site_change import roll_out
from bus_sim.systems.cell.tree import ContractTree
from onboard.config.site import site_digest
from onboard.contract.cell import ArmProgress, GoalStart, PartAt
from onboard.contract.change import ChangePhase, SiteNext
from onboard.contract.codes import OrderResult, TaskPhase
from onboard.contract.messages import Bid, CallForProposals, Heartbeat, Reference, TaskReport
from onboard.systems.cell.contracts import Goal
from onboard.systems.cell.geometry import Area, distance_m
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.cell.site import Cell
from tests.cell.playing import Scene, cell, goal_demand
from tests.cell.witness import ARMS, DESK, HOMES, arm, metres
from tests.cut import Timed, shown_at


def _late(node: int, after_s: float, run: BusRun[Any]) -> None:
    """One robot's controller is off at first and is switched on later."""
    machine = run.site.machines[node]
    run.loop.call_at(0.001, partial(run.crash, machine))
    run.loop.call_at(after_s, partial(run.start_controller, machine))


def test_c02_a_robot_that_joins_makes_the_goal_possible() -> None:
    scene = Scene(cell(), partial(_late, 3, 40.0))
    scene.assert_sound()
    assert scene.entries[0].result is OrderResult.DONE

    def check(heard: Sequence[Timed]) -> None:
        first_us = min((at for at, one in heard if isinstance(one, Heartbeat) and one.sender == 3), default=0)
        assert first_us > 39_000_000
        attempts = [at for at, one in heard if isinstance(one, CallForProposals) and one.sender == DESK]
        assert len([at for at in attempts if at < first_us]) > 1
        bids = [(at, one) for at, one in heard if isinstance(one, Bid) and one.initiator == DESK]
        assert len(bids) == 1 and bids[0][0] > first_us
        # It is bid for as before: the robots that were there have nothing better.
        assert bids[0][1].cost == 65212
        done = [one.task for _, one in heard if isinstance(one, TaskReport) and one.phase is TaskPhase.DONE]
        assert done[-1:] == [Reference(DESK, 1)]

    shown_at(check, scene.played.messages, Heartbeat, CallForProposals, Bid, TaskReport)


def test_c02_a_robot_that_was_in_no_site_file_joins_live() -> None:
    """The operator rolls out a file with one robot more; heartbeats name both sites, and all stay machines of one."""
    new = _with_digest(cell())
    old = _with_digest(cell(arms=tuple(one for one in ARMS if one.node_id != 3)))
    scene = Scene(new, partial(roll_out, old=old, at_us=40_000_000))
    scene.assert_sound()
    assert scene.entries[0].result is OrderResult.DONE
    others = set(old.machines)

    def check(heard: Sequence[Timed]) -> None:
        joined_us = min((at for at, one in heard if isinstance(one, Heartbeat) and one.sender == 3), default=0)
        attempts = [at for at, one in heard if isinstance(one, CallForProposals) and one.sender == DESK]
        assert len([at for at in attempts if at < joined_us]) > 1, "in vain"
        named = {
            (one.sender, one.site_digest, one.next_digest)
            for at, one in heard
            if isinstance(one, SiteNext) and one.change_phase is ChangePhase.HEARD and at < joined_us
        }
        assert named == {(node, *both) for node in others for both in (_pair(old, new), _pair(new, old))}
        beats = {(one.sender, one.site_digest) for at, one in heard if isinstance(one, Heartbeat) and at < joined_us}
        assert beats == {(node, one.digest) for node in others for one in (old, new)}
        bids = [(at, one) for at, one in heard if isinstance(one, Bid) and one.initiator == DESK]
        assert len(bids) == 1 and bids[0][0] > joined_us and bids[0][1].cost == 65212
        done = [one.task for _, one in heard if isinstance(one, TaskReport) and one.phase is TaskPhase.DONE]
        assert done[-1:] == [Reference(DESK, 1)]

    shown_at(check, scene.played.messages, Heartbeat, SiteNext, CallForProposals, Bid, TaskReport)
    told = [text for _, source, text in scene.played.run.log.lines if source == "operator"]
    assert told[-1] == "all machines take part by the new file"


def _with_digest(site: Cell) -> Cell:
    return replace(site, digest=site_digest(site))


def _pair(one: Cell, other: Cell) -> tuple[int, int]:
    return one.digest, other.digest


@pytest.mark.parametrize("later_s", [0, 400])
def test_c15_the_earlier_deadline_goes_first(later_s: int) -> None:
    one_robot = (arm(1, (0, 0, 20, 20), (1, 1)),)
    goals = (
        goal_demand((2, 2), (18, 2)),
        goal_demand((2, 6), (18, 6), at_s=6, within_s=later_s),
        goal_demand((2, 4), (18, 4), at_s=7, within_s=200),
    )
    scene = Scene(cell(*goals, arms=one_robot))
    scene.assert_sound()
    won = {one.task.number: time_us for time_us, one in reversed(list(scene.said(TaskReport)))}
    begun_us = next(time_us for time_us, one in scene.said(PartAt) if one.aboard and one.part.number != 1)
    assert won[2] < begun_us and won[3] < begun_us
    assert [part.number for part, _ in scene.plant.takes] == [1, 3, 2]


def test_c14_c15_what_cannot_be_in_time_is_declined() -> None:
    one_robot = (arm(1, (0, 0, 20, 20), (1, 1)),)
    # 17 m at 1 m/s and two grips of 2 s: 21 s at least.
    scene = Scene(
        cell(goal_demand((2, 1), (18, 1), within_s=20), goal_demand((2, 1), (18, 1), within_s=100), arms=one_robot)
    )
    scene.assert_sound()
    assert [one.result for one in scene.entries] == [OrderResult.REFUSED, OrderResult.DONE]


def test_c16_a_bid_begins_where_the_contract_in_hand_ends() -> None:
    one_robot = (arm(1, (0, 0, 20, 20), (1, 1), unit_cost=2.0),)
    scene = Scene(cell(goal_demand((2, 1), (18, 1)), goal_demand((18, 3), (2, 3), at_s=6), arms=one_robot))
    scene.assert_sound()
    bids = [one.cost for _, one in scene.said(Bid)]
    # From (1, 1): 1 m and 16 m at 2 a metre; then from (18, 1), not from where it is: 2 m and 16 m.
    assert bids == [34_000, 36_000]
    state = scene.robot(1)
    assert state.generation.position == metres(2, 3) and not state.generation.engaged
    assert state.generation.arm.area == Area(0, 0, 20_000, 20_000)


def _named_last(run: BusRun[Any]) -> None:
    """Of the 65,535 names for parts of goals each robot has used all but the last two."""
    for node in (one.node_id for one in ARMS):
        behaviour = run.controllers[node].holon.behaviour
        assert isinstance(behaviour, ArmRobot)
        behaviour.generation.number = 65_533


def _names_end(run: BusRun[Any]) -> None:
    run.loop.call_at(1.0, _named_last, run)


def test_c17_several_goals_of_two_managers_at_once() -> None:
    goals = (
        goal_demand((10, 10), (40, 30)),
        goal_demand((12, 30), (25, 34)),
        goal_demand((40, 4), (36, 32)),
        goal_demand((6, 20), (10, 6)),
    )
    scene = Scene(cell(*goals, desks=(DESK, 10)), _names_end)
    scene.assert_sound()
    assert [one.result for one in scene.entries] == [OrderResult.DONE] * 4
    names = {one.goal for _, one in scene.said(GoalStart) if one.sender in HOMES}
    assert {1, 65_534, 65_535} <= names, "the first name comes behind the last"
    calls = [(time_us, one) for time_us, one in scene.said(CallForProposals) if one.depth == 0]
    first_bid_us = min(time_us for time_us, one in scene.said(Bid) if one.initiator in (DESK, 10))
    assert sum(time_us < first_bid_us for time_us, _ in calls) == 4
    chains = {
        task: [one.contractor for one in scene.view.chain(task)]
        for task in (Reference(DESK, 1), Reference(DESK, 2), Reference(10, 1), Reference(10, 2))
    }
    assert chains == {
        Reference(DESK, 1): [1, 2, 3],
        Reference(DESK, 2): [2, 3],
        Reference(10, 1): [4, 5],
        Reference(10, 2): [4, 1],
    }


def test_c02_c19_a_goal_that_cannot_be_achieved_is_told_and_nothing_moves() -> None:
    """No robot joins that could: after three calls in vain the counter is told."""
    apart = (arm(1, (0, 0, 10, 10), (1, 1)), arm(2, (12, 0, 20, 10), (15, 5)))
    scene = Scene(cell(goal_demand((2, 2), (18, 2)), arms=apart))
    scene.assert_sound()
    assert scene.entries[0].result is OrderResult.REFUSED
    assert len([one for _, one in scene.said(CallForProposals) if one.sender == DESK]) == 3 * 5, "attempts"
    assert scene.view.text(Reference(DESK, 1)) == "The goal can not be achieved\n"
    assert {(one.x_mm, one.y_mm) for _, one in scene.said(ArmProgress)} == {metres(1, 1), metres(15, 5)}
    assert scene.plant.parts.lying == {Reference(DESK, 1): metres(2, 2)}


@pytest.mark.parametrize("case", range(4))
def test_c20_the_robots_find_what_the_exhaustive_search_finds(case: int) -> None:
    """Other geometries and unit costs, over frames; a bid's whole millimetres hide differences below one."""
    tool = Area(26_000, 8_000, 28_000, 11_000)
    arms = (
        ARMS,
        tuple(
            arm(a.node_id, _metres(a.area), (a.home.x_mm // 1000, a.home.y_mm // 1000), 1 + a.node_id % 3) for a in ARMS
        ),
        ARMS,
        (*ARMS, arm(6, (8, 8, 30, 20), (12, 18), 0.5)),
    )[case]
    obstacles = ((), (), (tool,), ())[case]
    start, end = (((10, 10), (40, 30)), ((10, 10), (40, 30)), ((10, 10), (40, 30)), ((4, 6), (44, 32)))[case]
    scene = Scene(cell(goal_demand(start, end), arms=arms, obstacles=obstacles))
    scene.assert_sound()
    homes = {one.node_id: one.home for one in arms}
    goal = Goal(Reference(DESK, 1), Reference(DESK, 1), metres(*start), metres(*end))
    best = ContractTree(arms, homes, obstacles).solve(goal)
    assert best is not None and best.cost >= distance_m(goal.start, goal.end) * 0.5
    chain = scene.view.chain(Reference(DESK, 1))
    assert tuple(one.contractor for one in chain) == best.nodes
    assert chain[0].cost == pytest.approx(best.cost, abs=1e-9)


def _metres(area: Area) -> tuple[int, int, int, int]:
    x0, y0, x1, y1 = (value // 1000 for value in area)
    return x0, y0, x1, y1

"""A robot of a cell in a person's hand: it stands where it is, and what it has not begun others do (row M38)."""

from typing import Any

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.run import BusRun
from onboard.contract.cell import ArmProgress
from onboard.contract.codes import CallResult, OrderResult
from onboard.contract.messages import Award, CallForProposals, Halted, ManualState
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.site import Cell
from tests.cell.playing import Scene, cell, goal_demand
from tests.cell.witness import DESK
from tests.cell.witness import arm as robot

#: Two robots that reach all of one area; the first is the nearer to what comes.
BOTH = tuple(robot(node, (0, 0, 40, 20), home) for node, home in ((1, (2, 2)), (2, (38, 18))))


def played(site: Cell, *held: str, limit_s: float = 600) -> Scene:
    def strike(run: BusRun[Any]) -> None:
        arm(run, [parse_injection(f"held:{one}") for one in held])

    return Scene(site, strike, limit_s)


def rests(scene: Scene, node: int) -> int:
    """When it first said that it has come to rest, us."""
    return next(t for t, one in scene.said(ManualState) if one.sender == node and one.at_rest)


def places(scene: Scene, node: int, from_us: int, to_us: int) -> set[Point]:
    words = scene.said(ArmProgress)
    return {Point(one.x_mm, one.y_mm) for t, one in words if one.sender == node and from_us <= t < to_us}


def test_a_robot_stands_within_a_second_on_its_way_and_goes_on_from_there() -> None:
    scene = played(cell(goal_demand((10, 10), (30, 10)), arms=BOTH), "target=R1,at_s=20,for_s=30")
    scene.assert_sound()
    assert 20_000_000 < rests(scene, 1) < 21_000_000
    (where,) = places(scene, 1, rests(scene, 1), 50_000_000)
    assert where not in (Point(2_000, 2_000), Point(10_000, 10_000), Point(30_000, 10_000))
    assert scene.entries[0].result is OrderResult.DONE and (scene.entries[0].ended_us or 0) > 50_000_000


def test_what_it_has_not_begun_others_do_after_a_minute_and_what_is_aboard_stays() -> None:
    goals = [goal_demand((10, 10), (30, 10)), goal_demand((10, 12), (30, 12), at_s=1)]
    scene = played(cell(*goals, arms=BOTH), "target=R1,at_s=32,for_s=500", limit_s=400)
    aboard, other = scene.entries
    assert other.result is OrderResult.DONE and 92_000_000 < (other.ended_us or 0) < 200_000_000
    assert aboard.result is not OrderResult.DONE and scene.plant.violations == []


def test_a_goal_that_only_a_held_robot_can_achieve_waits_until_its_time_is_over() -> None:
    goals = [goal_demand((10, 10), (30, 10), at_s=30), goal_demand((10, 12), (30, 12), at_s=30, within_s=60)]
    scene = played(cell(*goals, arms=BOTH[:1]), "target=R1,at_s=20,for_s=120")
    scene.assert_sound()
    waits, in_time = scene.entries
    assert waits.result is OrderResult.DONE and (waits.ended_us or 0) > 140_000_000
    assert in_time.result is OrderResult.REFUSED and (in_time.ended_us or 0) < 130_000_000
    calls = [one for t, one in scene.said(CallForProposals) if one.sender == DESK and 60_000_000 < t < 140_000_000]
    assert len(calls) < 25, "not over and over while nobody can come"


def handed_over(held: str) -> Scene:
    """A part that goes from R1 to R2, which takes it up at 40 s; R3 could too, from farther off."""
    arms = (robot(1, (0, 0, 20, 20), (8, 8)), robot(2, (20, 0, 40, 20), (30, 8)), robot(3, (20, 0, 40, 20), (38, 18)))
    return played(cell(goal_demand((10, 10), (30, 10)), arms=arms), held)


def test_a_sub_contractor_gives_back_what_it_has_not_taken_up_and_its_manager_finds_another() -> None:
    scene = handed_over("target=R2,at_s=36,for_s=400")
    assert scene.entries[0].result is OrderResult.DONE and 96_000_000 < (scene.entries[0].ended_us or 0) < 200_000_000
    awards = [(t, one.winner) for t, one in scene.said(Award) if one.sender == 1 and one.result is CallResult.AWARDED]
    assert awards[-1][1] == 3 and awards[-1][0] > 96_000_000
    assert scene.plant.violations == []


def test_nobody_calls_for_a_person_while_a_sub_contractor_is_held_and_then_it_goes_on() -> None:
    """The desk said of the main contractor, which had done its part, that it stood, and that a person was needed."""
    scene = handed_over("target=R2,at_s=45,for_s=300")
    scene.assert_sound()
    assert not list(scene.said(Halted))
    assert scene.entries[0].result is OrderResult.DONE and (scene.entries[0].ended_us or 0) > 345_000_000
    lines = [text for _, who, text in scene.played.run.log.lines if who == "R1" and " waits: " in text]
    assert lines == ["the rest of goal 1 of GM9 waits: R2 has it, and is held"]

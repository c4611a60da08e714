"""The paper's run over CAN frames: nobody but the robots themselves decides (rows C03 to C24)."""

from pathlib import Path

import pytest

from bus_sim.systems.cell.plant import CellPlant
from bus_sim.systems.cell.show import plan
from onboard.contract.cell import ArmPhase, ArmProgress, GoalPath, GoalStart, GoalTerms, OfferNodes, PartAt
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, OrderResult, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, Reference, TaskReport
from onboard.holon.holon import Holon
from onboard.systems.cell.fields import offered_by, path_of
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.memory import undertakings
from tests.cell.playing import Scene, cell
from tests.cell.witness import DESK, GOAL, metres

TASK = Reference(DESK, 1)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The paper's goal, once."""
    return Scene(cell())


def _calls(scene: Scene) -> list[tuple[int, CallForProposals]]:
    return list(scene.said(CallForProposals))


def test_c21_c22_c24_the_printed_answer_is_made_of_frames_alone(scene: Scene) -> None:
    scene.assert_sound()
    golden = Path(__file__).with_name("printed_run.txt").read_text(encoding="utf-8")
    assert scene.view.text(TASK) == golden


def test_c03_c05_the_goal_goes_to_all_and_the_best_offer_is_told(scene: Scene) -> None:
    at_us, call = next(iter(_calls(scene)))
    assert (call.sender, call.task, call.depth) == (DESK, TASK, 0)
    assert (call.operation, call.kind, call.criterion) == (Operation.REACH, KindCode.ARM, Criterion.LENGTH)
    # Its places were told right before; declining is silence, so the only answer is R1's, with cost and name.
    starts = [(time_us, one) for time_us, one in scene.said(GoalStart) if one.sender == DESK]
    assert starts[0][0] < at_us and (starts[0][1].x_mm, starts[0][1].y_mm) == GOAL.start
    bids = [one for _, one in scene.said(Bid) if (one.initiator, one.call) == (DESK, call.call)]
    assert [(one.sender, one.cost) for one in bids] == [(1, 65212)]
    award = next(one for _, one in scene.said(Award) if one.sender == DESK)
    assert (award.winner, award.task, award.result) == (1, TASK, CallResult.AWARDED)
    assert all(
        one.holon.negotiation.counters.calls_heard for node, one in scene.played.run.controllers.items() if node < DESK
    )
    # Who has nothing to say of it counts it as passed over, which the run's figures tell.
    silent = set(scene.site.arms) - {1}
    assert all(sum(scene.robot(node).generation.passed_over.values()) > 0 for node in silent)


def test_c04_robots_hand_over_inside_their_own_areas(scene: Scene) -> None:
    for _, word in scene.said(ArmProgress):
        assert scene.site.arms[word.sender].area.contains(Point(word.x_mm, word.y_mm))
    assert [node for _, node in scene.plant.takes] == [1, 2, 3]
    lying = [(one.sender, Point(one.x_mm, one.y_mm)) for _, one in scene.said(PartAt) if not one.aboard]
    handed = [(node, place) for node, place in lying if node != DESK]
    assert list(dict.fromkeys(handed)) == [(1, metres(22, 10)), (2, metres(30, 18)), (3, metres(40, 30))]
    assert scene.plant.parts.lying == {TASK: GOAL.end}


def test_c06_c10_three_sub_goals_go_to_all_others_and_the_first_finds_nobody(scene: Scene) -> None:
    parts = {one.task: one for _, one in _calls(scene) if one.sender == 1}
    starts = {one.goal: Point(one.x_mm, one.y_mm) for _, one in scene.said(GoalStart) if one.sender == 1}
    assert {starts[task.number] for task in parts} == {metres(16, 16), metres(22, 10), metres(10, 16)}
    assert {one.depth for one in parts.values()} == {1}
    ends = {starts[one.task.number]: (one.result, one.winner) for _, one in scene.said(Award) if one.sender == 1}
    assert ends[metres(16, 16)] == (CallResult.REFUSED, 0)
    assert ends[metres(22, 10)] == (CallResult.AWARDED, 2)
    assert ends[metres(10, 16)] == (CallResult.WITHDRAWN, 0)


def test_c07_a_robot_is_contractor_and_manager_at_the_same_time(scene: Scene) -> None:
    heard_us = next(time_us for time_us, one in _calls(scene) if one.sender == 1 and one.depth == 1)
    called_us = next(time_us for time_us, one in _calls(scene) if one.sender == 2)
    bid_us = next(time_us for time_us, one in scene.said(Bid) if one.sender == 2)
    assert heard_us < called_us < bid_us


def test_c11_levels_are_on_the_bus_and_the_deepest_is_decided_first(scene: Scene) -> None:
    levels = {Reference(one.sender, one.goal): one.level for _, one in scene.said(GoalTerms)}
    assert {one.depth for _, one in _calls(scene)} == {0, 1, 2, 3}
    assert all(levels[one.task] == one.depth for _, one in _calls(scene))
    # Of two goals one of which was made for the other the deeper one's call ends first.
    by_call = {(one.sender, one.call): one for _, one in _calls(scene)}
    for one in by_call.values():
        if one.depth:
            assert one.deadline_ms < by_call[one.parent.origin, one.parent.number].deadline_ms


def test_c12_c13_predecessors_and_robots_elsewhere_pass_goals_over(scene: Scene) -> None:
    paths = {Reference(one.sender, one.goal): path_of(one, 3) for _, one in scene.said(GoalPath)}
    by_call = {(one.sender, one.call): one for _, one in _calls(scene)}
    for _, bid in scene.said(Bid):
        path = paths[by_call[bid.initiator, bid.call].task]
        assert bid.sender not in path
    passed: dict[str, int] = {}
    for node in scene.site.arms:
        for why, times in scene.robot(node).generation.passed_over.items():
            passed[why] = passed.get(why, 0) + times
    # The bus carries each goal once; of the deliveries all but those to robots that can begin are passed over.
    looked = sum(scene.robot(node).generation.looked_at for node in scene.site.arms)
    assert passed["PREDECESSOR"] > 0 and passed["START"] > 0
    assert looked - sum(passed.values()) == 8


def test_c14_a_contract_names_places_cost_robots_and_time_limit(scene: Scene) -> None:
    offers = [offered_by(one, None) for _, one in scene.said(OfferNodes) if one.manager == DESK]
    assert offers == [(1, 2, 3)]
    journal = scene.played.run.journals[1].replay()
    (mine,) = undertakings(journal).values()
    contract = mine.contract
    assert (contract.goal.start, contract.goal.end, contract.move.via) == (GOAL.start, GOAL.end, metres(22, 10))
    assert f"{contract.cost:.13f}" == "65.2119063886405" and contract.nodes == (1, 2, 3)
    assert contract.goal.time_limit_ms == 0


def test_c18_managers_hear_of_completion_only(scene: Scene) -> None:
    """Once the winner has answered the award: one word, when the goal is achieved, on each level."""
    for manager in (DESK, 1, 2):
        words = [one.phase for _, one in scene.said(TaskReport) if one.task.origin == manager]
        assert list(dict.fromkeys(words)) == [TaskPhase.AWARDED, TaskPhase.DONE]
    done = [one.task.origin for _, one in scene.said(TaskReport) if one.phase is TaskPhase.DONE]
    assert list(dict.fromkeys(done)) == [2, 1, DESK]
    assert scene.entries[0].result is OrderResult.DONE


def test_c23_the_plan_shows_areas_robots_and_part(scene: Scene) -> None:
    plant = scene.plant
    assert isinstance(plant, CellPlant)
    text = plan(plant, scene.view)
    assert all(name in text for name in ("R1", "R2", "R3", "R4", "R5"))
    assert "order 1: (10, 10) to (40, 30): DONE" in text
    assert sum(line.count(".") for line in text.splitlines()) > 200


def test_p59_the_cell_runs_on_the_same_holon_as_the_car_park(scene: Scene) -> None:
    assert {type(one.holon) for one in scene.played.run.controllers.values()} == {Holon}
    for layer in ("core", "holon"):
        files = list((Path(__file__).parents[2] / "onboard" / layer).rglob("*.py"))
        assert files and [file for file in files if "onboard.systems" in file.read_text(encoding="utf-8")] == []
    phases = [one.arm_phase for _, one in scene.said(ArmProgress) if one.sender == 1]
    assert list(dict.fromkeys(phases))[:5] == [
        *(ArmPhase.IDLE, ArmPhase.WAITING, ArmPhase.TO_PART, ArmPhase.TAKING, ArmPhase.CARRYING)
    ]

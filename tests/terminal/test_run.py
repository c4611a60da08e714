"""The shipped terminal, run once to its end, and what was on its buses."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import pytest

from bus_sim.cli import main
from bus_sim.options import RunOptions
from bus_sim.sites import find_site
from bus_sim.systems.terminal.central import at_one_desk, play_auction, play_central
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun
from bus_sim.systems.terminal.show import summary_lines
from bus_sim.systems.terminal.table import picture
from onboard.contract.codes import CallResult, TaskPhase
from onboard.contract.messages import Award, CallForProposals, Message, TaskReport
from onboard.contract.terminal import (
    Action,
    Assignment,
    LaneState,
    PlanHead,
    PlanStep,
    PlanTask,
    StepReport,
    StepResult,
)
from onboard.contract.terminal_device import MoveOrder
from onboard.systems.terminal.vehicle import Vehicle, terminal
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.check.checks import Checks, check_records
from onboard.trace.check.holds import HoldAnswered, LetGoAgain
from tests.terminal.seeds import short

M = TypeVar("M", bound=Message)
SITE = terminal(find_site("terminal"))
L11 = SITE.by_name["L11"].number
SECOND = 1_000_000


@dataclass
class Seen:
    """One run: what it came to, every message of the fleet bus with its time, what was looked at on the way."""

    outcome: TerminalOutcome
    trace: Path
    heard: list[tuple[int, Message]] = field(default_factory=list)
    orders: list[MoveOrder] = field(default_factory=list)
    versions: list[set[tuple[tuple[int, int], ...]]] = field(default_factory=list)
    ends: list[dict[int, int]] = field(default_factory=list)
    pictures: list[list[str]] = field(default_factory=list)

    def of(self, kind: type[M]) -> list[tuple[int, M]]:
        return [(time_us, message) for time_us, message in self.heard if isinstance(message, kind)]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    trace = tmp_path_factory.mktemp("terminal") / "run.log"
    found = Seen(None, trace)  # type: ignore[arg-type]  # the outcome comes at the end

    def prepare(run: TerminalRun) -> None:
        run.observers.append(lambda message, time_us: found.heard.append((time_us, message)))
        for devices in run.plant.vehicles.values():
            devices.link.incoming.append(keep)

    def keep(message: Message) -> Message:
        if isinstance(message, MoveOrder):
            found.orders.append(message)
        return message

    def look(run: TerminalRun) -> None:
        vehicles = [one.holon.behaviour for one in run.controllers.values()]
        mirrors = [one.mirror.traffic for one in vehicles if isinstance(one, Vehicle)]
        found.versions.append(
            {tuple(sorted((owner, owned.plan.version) for owner, owned in one.plans.items())) for one in mirrors}
        )
        now_us = run.loop.now_us()
        found.ends.append({owner: run.spectator.traffic.end_of(owner, now_us) for owner in run.spectator.traffic.plans})
        found.pictures.append(picture(SITE, run.spectator, now_us))

    options = RunOptions(seed=1, trace=trace, devices=True)
    found.outcome = play(SITE, options, prepare=prepare, show=look)
    return found


def test_m01_m04_m05_all_missions_are_done_and_nothing_breaks(seen: Seen) -> None:
    assert seen.outcome.is_good, (seen.outcome.violations, seen.outcome.halted, len(seen.outcome.deliveries))
    by_mission = {number: [one.box for one in seen.outcome.deliveries if one.mission == number] for number in (1, 2, 3)}
    types = {SITE.boxes[box - 1].type for box in by_mission[1]}
    assert (len(by_mission[1]), types) == (4, {"T1"})
    assert sorted(SITE.boxes[box - 1].name for box in by_mission[2]) == ["B11", "B12", "B13"]
    assert not [one for one in seen.outcome.deliveries if one.late_us]


def test_every_rule_holds_over_the_whole_log(seen: Seen) -> None:
    with seen.trace.open("rb") as lines:
        verdict = check_records(CandumpReader(lines), Checks(SITE))
    assert verdict.is_good, verdict.lines()
    judged = [rule for rule in verdict.rules if rule not in (HoldAnswered, LetGoAgain)]
    assert all(verdict.seen[rule.name] for rule in judged), "every rule had something to judge; nobody is held here"


def test_m07_a_robot_puts_down_what_it_has_before_it_picks_up_more(seen: Seen) -> None:
    plans: dict[tuple[int, int], list[PlanTask]] = {}
    for _, task in seen.of(PlanTask):
        plans.setdefault((task.sender, task.version), []).append(task)
    assert any(len(tasks) > 1 for tasks in plans.values())
    for tasks in plans.values():
        ordered = sorted({(task.part, task.pick, task.put) for task in tasks})
        ends = [number for _, pick, put in ordered for number in ((pick, put) if pick < 31 else (put,))]
        assert ends == sorted(ends), "up, down, up, down"


def test_m11_inside_a_lane_the_vehicle_goes_slot_by_slot(seen: Seen) -> None:
    """The plan names the lane once; what happens inside it is between controller and drive."""
    orders = [(order.entity, order.slot) for order in dict.fromkeys(seen.orders)]
    lane = SITE.by_name["L3"].number
    slots = [slot for entity, slot in orders if entity == lane]
    assert set(slots) == {1, 2, 3} and slots.count(1) == slots.count(3)


def test_m03_m36_a_blocked_lane_is_told_to_all_and_nobody_enters_it(seen: Seen) -> None:
    told = [(time_us, state.blocked) for time_us, state in seen.of(LaneState) if state.lane == L11]
    assert told[0][1] and not told[-1][1]
    assert 100 * SECOND <= told[0][0] < 101 * SECOND
    free_us = next(time_us for time_us, blocked in told if not blocked)
    assert 190 * SECOND <= free_us < 191 * SECOND
    first = {(one.sender, one.version, one.step): (time_us, one) for time_us, one in reversed(seen.of(StepReport))}
    entered = [at for at, one in first.values() if one.result is StepResult.DONE and _entered(seen, one) == L11]
    assert entered and not [time_us for time_us in entered if told[0][0] + SECOND < time_us < free_us]


def _entered(seen: Seen, report: StepReport) -> int:
    steps = {(one.sender, one.version, one.step): one.entity for _, one in seen.of(PlanStep)}
    return steps.get((report.sender, report.version, report.step + 1), 0)


def test_m33_a_blocked_lane_is_waited_for_before_plans_are_made_anew(seen: Seen) -> None:
    heads = [time_us / SECOND for time_us, head in seen.of(PlanHead) if head.steps]
    won = [time_us / SECOND for time_us, award in seen.of(Award) if award.result is CallResult.AWARDED]
    during = [at for at in heads if 100 < at < 130 and not [one for one in won if 0 <= at - one < 2]]
    assert not during, "patience is 30 s"
    assert [at for at in heads if 130 <= at < 133]


def test_m32_m35_robots_that_would_use_the_lane_take_another_way_by_themselves(seen: Seen) -> None:
    anew = {(h.sender, h.version) for time_us, h in seen.of(PlanHead) if 130 <= time_us / SECOND < 133 and h.steps}
    entities = {
        key: [step.entity for _, step in seen.of(PlanStep) if (step.sender, step.version) == key][1:] for key in anew
    }
    assert len(anew) >= 3 and all(L11 not in ways for ways in entities.values())
    assert seen.outcome.touched == len(anew), "nobody else made a plan anew"
    tasks = {task.task for _, task in seen.of(PlanTask) if (task.sender, task.version) in anew}
    calls = [time_us for time_us, call in seen.of(CallForProposals) if call.task in tasks and time_us > 130 * SECOND]
    assert not calls, "no call for what is under way"


def test_m27_never_more_calls_than_robots_about_to_be_free(seen: Seen) -> None:
    """Eight boxes are ordered at once; the last call comes when robots are about to finish."""
    calls = [(time_us, call.task) for time_us, call in seen.of(CallForProposals)]
    assert len({task for at, task in calls if at < 30 * SECOND}) <= 2 * len(SITE.vehicles) - 1
    assert len({task for at, task in calls if at < 13 * SECOND}) < 8
    assert max(at for at, _ in calls) > 30 * SECOND


def test_m29_an_urgent_mission_interrupts_planning(seen: Seen) -> None:
    withdrawn = [award for _, award in seen.of(Award) if award.result is CallResult.WITHDRAWN]
    urgent = SITE.missions[-1].boxes[0]
    first = next(award for _, award in seen.of(Award) if award.result is CallResult.AWARDED)
    box = {call.task: call.car.number for _, call in seen.of(CallForProposals)}
    assert len(withdrawn) == seen.outcome.interrupted > 0
    assert box[first.task] == urgent
    assert all(box[award.task] != urgent for award in withdrawn)


def test_m28_all_keep_one_picture_while_plans_are_made_and_carried_out(seen: Seen) -> None:
    agreed = sum(len(versions) == 1 for versions in seen.versions[8:])
    assert agreed >= len(seen.versions[8:]) - 3, "but for plans on their way"
    calls = [time_us for time_us, _ in seen.of(CallForProposals)]
    reports = [time_us for time_us, _ in seen.of(StepReport)]
    assert [at for at in calls if min(reports) < at < max(reports)]


def test_m37_the_ends_of_all_plans_are_known_all_the_time_and_move(seen: Seen) -> None:
    known = [ends for ends in seen.ends if 11 in ends]
    assert len({ends[11] for ends in known}) > 10
    shown = "\n".join(line for lines in seen.pictures for line in lines)
    assert "L11: . BLOCKED" in shown or "BLOCKED" in shown
    assert "R1[" in shown and "ends at" in shown and "idle in" in shown
    assert re.search(r"S\d+: B\d+", shown) and re.search(r"S\d+: -", shown), "what stands where"


def test_m30_each_step_is_reported_once_done_and_the_task_at_its_phases(seen: Seen) -> None:
    reports = {(r.sender, r.version, r.step): r.at_ms for _, r in seen.of(StepReport) if r.result is StepResult.DONE}
    steps = {(s.sender, s.version, s.step): s.action for _, s in seen.of(PlanStep)}
    downs = [key for key, action in steps.items() if action is Action.PUT_DOWN and key in reports]
    assert len(downs) == 8
    done = [report for _, report in seen.of(TaskReport) if report.phase is TaskPhase.DONE]
    assert len({report.task for report in done}) == 8


def test_m39_no_machine_plans_for_another(seen: Seen) -> None:
    assert not seen.of(Assignment)
    assert {step.sender for _, step in seen.of(PlanStep)} == set(SITE.vehicles)


def test_m39_the_central_planner_on_the_same_plant_and_bus_does_the_same_missions() -> None:
    central = play_central(short(), RunOptions(seed=1), limit_us=900 * SECOND)
    auction = play_auction(short(), RunOptions(seed=1), limit_us=900 * SECOND)
    assert central.is_good and auction.is_good
    assert {one.desk for one in at_one_desk(short()).missions} == {1}
    assert auction.mean_s(lambda one: one.finished_us) <= 1.1 * central.mean_s(lambda one: one.finished_us)
    assert central.frames != auction.frames


def test_the_command_runs_the_terminal_and_says_how_it_went(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, seen: Seen
) -> None:
    trace, told = tmp_path / "again.log", tmp_path / "told.json"
    assert main(["run", "terminal", "--trace", str(trace), "--devices", "--json", str(told)]) == 0
    shown = capsys.readouterr().out
    assert "8 of 8 boxes put down" in shown and "Unloading Task GOTO" in shown
    assert all(line in shown for line in summary_lines(SITE, seen.outcome))
    assert trace.read_bytes() == seen.trace.read_bytes(), "the same seed, the same log"
    assert '"good": true' in told.read_text(encoding="utf-8")

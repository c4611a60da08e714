"""Calls and customers' stories told from a log: what a run did is what they say, and planted causes are named."""

from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from onboard.contract.codes import CallResult, Grade, LegAction, Reason, Side, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Heartbeat,
    Itinerary,
    Leg,
    Progress,
    Reference,
    Stamp,
    TaskReport,
)
from onboard.trace.cli import main
from onboard.trace.story.why import TaskStory, WaitingStory, task_lines
from onboard.trace.view import SiteView
from onboard.trace.words import Words
from tests.trace.runs import SITE, SITE_FILE, first, fleet_of, run_log

PARK, FETCH = Reference(1, 1), Reference(1, 2)


def _story(*words: str, task: Reference = PARK) -> TaskStory:
    why = WaitingStory(SITE)
    for said in fleet_of(run_log(*words)):
        why.feed(said.message, said.time_us)
    why.finish()
    return why.tasks[task]


def _spent_s(story: TaskStory, node: int, word: str) -> float:
    """Seconds of the story that are put down to a machine for a cause with this word."""
    return sum(one.length_us for one in story.parts if one.cause.whom == node and word in one.cause.what) / 1e6


@pytest.mark.parametrize("task", [PARK, FETCH])
def test_the_parts_of_a_story_sum_to_the_customers_waiting_time(task: Reference) -> None:
    story = _story(task=task)
    said = [one for one in fleet_of(run_log()) if getattr(one.message, "task", None) == task]
    called_us = next(one.time_us for one in said if isinstance(one.message, CallForProposals))
    done_us = next(
        one.time_us for one in said if isinstance(one.message, TaskReport) and one.message.phase is TaskPhase.DONE
    )
    assert (story.begin_us, story.end_us) == (called_us, done_us)
    assert sum(part.length_us for part in story.parts) == done_us - called_us == story.waited_us
    assert all(one.end_us == two.begin_us for one, two in zip(story.parts, story.parts[1:], strict=False))
    assert story.parts[0].begin_us == called_us


def test_an_undisturbed_story_names_the_handling_the_way_and_the_lift() -> None:
    story = _story()
    assert _spent_s(story, 11, "takes the car at IOC1") > 15
    assert _spent_s(story, 11, "leaves the car") > 15
    assert _spent_s(story, 11, "drives") > 10
    assert _spent_s(story, 5, "carries the robot") > 3
    assert _spent_s(story, 1, "call open") == pytest.approx(1.0, abs=0.1)


def test_a_load_is_left_where_it_goes_and_taken_where_it_was() -> None:
    for story in (_story(), _story(task=FETCH)):
        at = [one.cause.what.rpartition(" ")[2] for one in story.parts if "the car at" in one.cause.what]
        assert len(set(at)) == 2 and "leaves the car at " + at[0] not in {one.cause.what for one in story.parts}


def _called_off(*, until_us: int, is_begun: bool) -> tuple[TaskStory, bool, int]:
    """The fetch, which its caller wants no more once it is awarded; whether the page counts it then, and when that was.

    ``is_begun``: the robot did not hear so. The log ends ``until_us`` later.
    """
    why, view, off_us = WaitingStory(SITE), SiteView(SITE), 0
    for said in fleet_of(run_log()):
        message = said.message
        if off_us and (said.time_us > off_us + until_us or (isinstance(message, TaskReport) and not is_begun)):
            continue
        told = [message]
        if isinstance(message, Award) and message.task == FETCH:
            told, off_us = [message, Award(1, 0, 0, FETCH, 0, CallResult.WITHDRAWN, Reason.CANCELLED)], said.time_us
        for one in told:
            why.feed(one, said.time_us)
            view.feed(one, said.time_us)
    why.finish()
    return why.tasks[FETCH], view.tasks[FETCH].is_waiting, off_us


def test_who_is_called_off_is_waited_for_no_longer() -> None:
    """It was "still busy" with such a task to the end of the log, and the page counted a customer who waits."""
    story, is_waiting, off_us = _called_off(until_us=60_000_000, is_begun=False)
    assert not is_waiting
    assert (story.end_us, story.waited_us) == (off_us, off_us - story.begin_us)
    assert "called off" in task_lines(story, Words(SITE), 0)[0]


def test_who_begins_what_was_called_off_is_waited_for_again() -> None:
    story, is_waiting, _ = _called_off(until_us=40_000_000, is_begun=True)
    assert is_waiting and story.end_us is None
    story, _, _ = _called_off(until_us=600_000_000, is_begun=True)
    assert "served" in task_lines(story, Words(SITE), 0)[0]
    assert sum(part.length_us for part in story.parts) == story.waited_us


@pytest.mark.parametrize("is_taken", [False, True], ids=["behind a way", "behind taking the car"])
def test_who_stands_as_planned_is_told_so(*, is_taken: bool) -> None:
    """Nothing is said when a wait begins: it was told as "about to move" for as long as it lasted."""
    why = WaitingStory(SITE)
    said = fleet_of(run_log())
    awarded_us = next(one.time_us for one in said if isinstance(one.message, Award))
    source = next(one.message.from_station for one in said if isinstance(one.message, CallForProposals))
    beat = next(one.message for one in said if isinstance(one.message, Heartbeat) and one.message.sender == 11)
    at, end_ms = source & 0x7F, [awarded_us // 1_000 + s * 1_000 for s in (10, 10, 40, 60)]
    stay = Leg(LegAction.WORK, 1, at, at, Side(source >> 7 & 1), end_ms[1])
    way = Leg(LegAction.TRAVEL, 1, 2, at, Side.NEAR, end_ms[0])
    wait, back = (
        Leg(one, 1, at, at, Side.NEAR, end)
        for one, end in zip((LegAction.STAND, LegAction.TRAVEL), end_ms[2:], strict=True)
    )
    legs = (way, stay, wait, back) if is_taken else (way, wait, back)
    told = [(one.time_us, one.message) for one in said if one.time_us <= awarded_us]
    told += [(awarded_us + 1_000, Itinerary(11, 200, Grade.FIRM, Stamp(0, 1, 1), legs))]
    told += [(awarded_us + 2_000, Progress(11, 200, 0, 1, 2, 0, 900))]
    told += [(awarded_us + 10_000_000, Progress(11, 200, 0, 1, at, 0, 0))]
    if is_taken:
        told += [(awarded_us + 10_000_001, TaskReport(11, PARK, TaskPhase.LOADED, source, Reason.NONE))]
    told += [(awarded_us + s * 1_000_000, beat) for s in range(11, 40)]
    told += [(awarded_us + 40_000_000, Progress(11, 200, len(legs) - 1, 1, at, 0, 900))]
    for time_us, message in told:
        why.feed(message, time_us)
    why.finish()
    assert _spent_s(why.tasks[PARK], 11, "stands as planned") == pytest.approx(30, abs=0.01)
    assert not _spent_s(why.tasks[PARK], 11, "about to move") > 0.01


@pytest.mark.parametrize(
    ("fault", "node", "word", "at_least_s"),
    [
        ("crash:target=MR1,at_s=30", 11, "started anew", 5),
        ("crash:target=MR1,at_s=30,restart=no", 11, "silent", 12),
        ("pause:target=MR1,at_s=40,for_s=30", 11, "silent", 12),
        ("actuator_stuck:target=ER1,at_s=12,for_s=60", 5, "is not ready", 14),
    ],
)
def test_a_planted_cause_is_found(fault: str, node: int, word: str, at_least_s: float) -> None:
    plain, story = _story(), _story("--for", "150", "--fault", fault)
    assert _spent_s(story, node, word) - _spent_s(plain, node, word) >= at_least_s
    assert sum(part.length_us for part in story.parts) == story.waited_us


def test_calls_are_told_with_bids_winner_promise_and_finish(capsys: pytest.CaptureFixture[str]) -> None:
    said = fleet_of(run_log())
    start_us = min(one.time_us for one in said)
    assert main(["calls", str(run_log()), "--site", str(SITE_FILE), "--task", "IOC1/1"]) == 0
    lines = capsys.readouterr().out.splitlines()

    def at(kind: type[CallForProposals] | type[Bid] | type[Award]) -> float:
        return (first(said, kind).time_us - start_us) / 1e6

    def moment(line: str) -> float:
        return float(line.split(maxsplit=1)[0])

    assert "IOC1 call" in lines[0] and "park car IOC1/1, task IOC1/1, IOC1 to anywhere" in lines[0]
    assert moment(lines[0]) == pytest.approx(at(CallForProposals), abs=0.01)
    assert "MR1 bids" in lines[1] and moment(lines[1]) == pytest.approx(at(Bid), abs=0.01)
    assert "awarded to MR1; promised" in lines[2] and moment(lines[2]) == pytest.approx(at(Award), abs=0.01)
    done_us = next(
        one.time_us for one in said if isinstance(one.message, TaskReport) and one.message.phase is TaskPhase.DONE
    )
    finished = float(lines[2].partition("finished ")[2].split()[0])
    assert finished == pytest.approx((done_us - start_us) / 1e6, abs=0.01)
    assert lines[-1] == "1 calls, 1 bids"


def test_why_prints_the_parts_and_their_sum(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(run_log()), "IOC1/2", "--site", str(SITE_FILE)]) == 0
    lines = capsys.readouterr().out.splitlines()
    waited = lines[0].rpartition("waited ")[2]
    assert lines[0].startswith("task IOC1/2: retrieve, called by IOC1 at") and ", served; " in lines[0]
    assert " ".join(lines[-1].split()) == f"sum {waited}"
    assert main(["why", str(run_log()), "--site", str(SITE_FILE)]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["IOC1/2", "IOC1/1"]


def test_a_task_may_be_named_last(capsys: pytest.CaptureFixture[str]) -> None:
    log, site = str(run_log()), str(SITE_FILE)
    assert main(["why", log, "--site", site, "IOC1/2"]) == 0
    assert capsys.readouterr().out.startswith("task IOC1/2: ")
    for words in (["IOC1/2", "IOC1/1"], ["IOC1/2", "--wide"]):
        with pytest.raises(SystemExit) as ended:
            main(["why", log, "--site", site, *words])
        assert ended.value.code == 2 and "unrecognized arguments: " in capsys.readouterr().err


@pytest.mark.parametrize(("task", "said"), [("IOC1/9", "no task IOC1/9 in it"), ("XY/1", "write CALLER/NUMBER")])
def test_a_task_that_is_not_there_is_one_clear_line(task: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(run_log()), task, "--site", str(SITE_FILE)]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1


def test_a_site_without_tracks_is_told_by_its_machines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "graph.log"
    bus_sim(["run", "graph", "--for", "300", "--speed", "max", "--trace", str(log)])
    site = str(SITE_FILE.with_name("graph.toml"))
    capsys.readouterr()
    assert main(["why", str(log), "--site", site]) == 0
    task = capsys.readouterr().out.split()[0]
    assert main(["why", str(log), task, "--site", site]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any("drives from N" in line for line in lines)
    assert lines[-1].split()[-2:] == lines[0].rpartition("waited ")[2].split()

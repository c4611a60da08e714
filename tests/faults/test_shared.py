"""A point that goes on from a shared beginning of its scene comes to what it comes to played from the start."""

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from multiprocessing import Pipe
from pathlib import Path

import pytest

from bus_sim.campaign import shared, table
from bus_sim.campaign.points import SceneCounts, Single, count, points, reference
from bus_sim.campaign.report import RunVerdict
from bus_sim.campaign.runner import CampaignSettings, FaultPoint, TrialResult, run_point, run_points
from bus_sim.campaign.shared import Copies, Crash, is_shared
from bus_sim.engine import on_cores
from bus_sim.faults.injection import Injection, parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.virtual_time import VirtualTimeLoop
from tests.thinned import is_long

SITE = "level1"
pytestmark = pytest.mark.skipif(not shared.can_share(), reason="no process can be copied on this platform")


@pytest.fixture(scope="module")
def counts() -> SceneCounts:
    return count(find_site(SITE), reference(SITE, 3_600.0))


def spread(single: Single, counts: SceneCounts, number: int) -> list[FaultPoint]:
    """So many of all points, evenly."""
    every = list(enumerate(points(find_site(SITE), single, counts), start=1))
    return [FaultPoint(*one) for one in every[5 :: len(every) // number]]


def rows(plan: CampaignSettings, results: Iterator[TrialResult]) -> tuple[list[str], object, list[TrialResult]]:
    found = sorted(results, key=lambda one: one.seed)
    return table.lines(found), table.to_json(plan, found), found


@pytest.mark.parametrize("single", [Single.CRASH, Single.JOURNAL])
def test_both_ways_come_to_the_same_table_and_rows(single: Single, counts: SceneCounts) -> None:
    plan, chosen = (
        CampaignSettings(SITE, single, 3_600.0, usual_wait_s=counts.longest_wait_s),
        spread(single, counts, 9 if is_long() else 3),
    )
    assert all(isinstance(one.fault, Injection) and is_shared(one.fault) for one in chosen)
    both = rows(plan, run_points(plan, chosen, 2))
    assert both == rows(plan, on_cores(1, partial(run_point, plan), chosen))
    assert len(both[2]) == len(chosen)


def test_a_point_that_never_comes_is_the_scene_without_a_fault(counts: SceneCounts) -> None:
    plan = CampaignSettings(SITE, "crash", 3_600.0)
    chosen = [
        FaultPoint(1, parse_injection("crash:target=MR1,at_s=0,restart_s=0.5,frame=100000")),
        FaultPoint(2, parse_injection("crash:target=MR1,at_s=0,restart_s=0.5,frame=20")),
    ]
    assert rows(plan, run_points(plan, chosen, 1)) == rows(plan, on_cores(1, partial(run_point, plan), chosen))


def test_a_failure_is_kept_as_of_a_point_that_is_played_alone(tmp_path: Path) -> None:
    # The car is not in yet when the run ends.
    chosen = [
        FaultPoint(number, parse_injection(f"crash:target=MR1,at_s=0,restart_s=0.5,frame={number}"))
        for number in (8, 9)
    ]
    plan = CampaignSettings(SITE, "crash", 25.0, out=tmp_path / "shared")
    found = {one.seed: one for one in run_points(plan, chosen, 1)}
    assert found[8].report.verdict is RunVerdict.NOT_SERVED
    alone = run_point(CampaignSettings(SITE, "crash", 25.0, out=tmp_path / "alone"), chosen[0])
    for name, other in zip(found[8].files, alone.files, strict=True):
        assert Path(name).read_bytes() == Path(other).read_bytes()


def test_a_copy_that_ends_without_an_answer_is_a_program_error() -> None:
    crash = Crash(7, Injection("crash", {"target": "MR1", "at_s": 0.0, "frame": 1}))
    here, there = Pipe(duplex=False)
    with here, there, closing(VirtualTimeLoop()) as loop:
        copies = Copies(FaultScenario(SITE), 1, there)
        if copies.copy(loop, crash):
            os._exit(3)
        copies.collect(most=0)
        answer = here.recv()
    assert (answer.number, answer.report.verdict) == (7, RunVerdict.CRASHED)
    assert answer.report.error == "its process ended with status 3 and no answer"
    assert answer.report.scenario.faults == (crash.fault,)


@pytest.mark.parametrize(
    "fault", ["crash:target=MR1,at_s=30", "crash:target=MR1,at_s=5,frame=9", "moved:target=MR1,at_s=0,by_mm=40"]
)
def test_other_faults_are_played_from_the_start(fault: str) -> None:
    one = parse_injection(fault)
    assert isinstance(one, Injection)
    assert not is_shared(one)


def test_without_copies_of_processes_each_point_is_played_from_the_start(
    counts: SceneCounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, chosen = CampaignSettings(SITE, "crash", 3_600.0), spread(Single.CRASH, counts, 2)[:2]
    monkeypatch.setattr("bus_sim.campaign.runner.can_share", lambda: False)
    monkeypatch.setattr("bus_sim.campaign.runner.play_shared", _never)
    assert [one.seed for one in run_points(plan, chosen, 1)] == [one.number for one in chosen]


def _never(*_words: object) -> Sequence[object]:
    raise AssertionError("no process can be copied")

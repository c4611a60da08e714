"""Every single fault of the reference scene is a point with a number; a sample of each kind withstands it."""

import random
from functools import cache
from pathlib import Path

import pytest

from bus_sim.campaign.journal_points import HELD_US, Held
from bus_sim.campaign.points import SceneCounts, SceneOccasion, Single, count, points, reference
from bus_sim.campaign.recovery import Measure
from bus_sim.campaign.report import RunVerdict
from bus_sim.campaign.runner import CampaignSettings, FaultPoint, run_point
from bus_sim.campaign.trial import play
from bus_sim.can.faults import InjectedFault
from bus_sim.cli import main
from bus_sim.faults.injection import AnyFault, Injection, parse_injection
from bus_sim.faults.journals import HARMS
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from onboard.contract.codes import KindCode, MachineState, Reason
from onboard.contract.messages import Halted, Heartbeat
from tests.thinned import is_long

SITE = "level1"
#: Whoever comes while a machine holds may be told that it is out of order.
GOOD = (RunVerdict.SERVED, RunVerdict.DELAYED, RunVerdict.TOLD)


@cache
def counts() -> SceneCounts:
    return count(find_site(SITE), reference(SITE, 3_600.0))


def every(single: Single) -> list[AnyFault]:
    return points(find_site(SITE), single, counts())


def test_each_frame_is_lost_once_at_each_of_its_receivers() -> None:
    omissions = [one for one in every(Single.OMISSION) if isinstance(one, InjectedFault)]
    assert len(omissions) == len(counts().fleet_senders), "two machines: one receiver a frame"
    assert [one.nth for one in omissions] == list(range(1, len(omissions) + 1))
    assert all(one.receivers != (sender,) for one, sender in zip(omissions, counts().fleet_senders, strict=True))


def test_each_machine_is_killed_at_each_frame_and_around_each_journal_write() -> None:
    crashes = [one for one in every(Single.CRASH) if isinstance(one, Injection)]
    robot = [one for one in crashes if one.target == "MR1" and one.number("restart_s") < 1]
    assert sum(one.count("frame") > 0 for one in robot) == counts().sent["MR1"]
    assert sum(one.count("write") > 0 for one in robot) == 2 * counts().written["MR1"]
    assert {one.target for one in crashes} == {"IOC1", "MR1"}
    assert [parse_injection(str(one)) for one in crashes] == crashes


@pytest.mark.parametrize("single", [Single.OMISSION, Single.DUPLICATE])
def test_a_sample_of_single_frames_lost_or_doubled_costs_nobody_the_car(single: Single) -> None:
    # Of the last frames the run hardly shows the effect; they are in the whole, not in the sample.
    chosen = random.Random(5).sample(list(enumerate(every(single)[:400], start=1)), 25 if is_long() else 12)
    plan = CampaignSettings(SITE, single, 3_600.0, usual_wait_s=counts().longest_wait_s)
    for number, fault in chosen:
        report = run_point(plan, FaultPoint(number, fault)).report
        assert (report.violations, report.error, report.waiting) == ((), "", 0), str(fault)


def test_a_point_that_fails_is_kept_and_can_be_played_again(tmp_path: Path) -> None:
    plan = CampaignSettings(SITE, "crash", 200.0, out=tmp_path)
    fault = parse_injection("actuator_stuck:target=IOC1,at_s=1,for_s=3000")
    result = run_point(plan, FaultPoint(7, fault))
    assert result.report.verdict is RunVerdict.NOT_SERVED
    assert (tmp_path / "level1-crash-7.log").stat().st_size > 0
    assert main(["run", "--scenario", str(tmp_path / "level1-crash-7.toml"), "--trace", str(tmp_path / "t.log")]) == 1


def test_the_command_plays_a_sample_of_the_points(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["campaign", SITE, "--exhaustive", "duplicate", "--sample", "3", "--jobs", "1"]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert f"duplicates on level1: 3 of {len(every(Single.DUPLICATE))} points" in told
    assert "3 customers: served 3" in told


def test_a_sample_of_nothing_is_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", SITE, "--sample", "3"]) == 2
    assert "--sample 3: must be 1 or more, and goes with --exhaustive or --cold-start" in capsys.readouterr().err


def test_every_write_of_every_machine_is_a_point_for_every_harm_to_its_journal() -> None:
    found = [one for one in every(Single.JOURNAL) if isinstance(one, Injection)]
    writes = counts().written["MR1"]
    robot = [one for one in found if one.target == "MR1"]
    assert sum(one.text("journal") == "torn" for one in robot) == writes
    assert sum(one.text("journal") == "cut" for one in robot) == sum(min(50, n) for n in range(1, writes + 1))
    assert {one.text("journal") for one in found} == HARMS.keys() - {"kept"}
    assert all((one.text("durable") == "no") == (one.text("journal") == "torn") for one in found)


@pytest.mark.parametrize("harm", ["torn", "cut,entries=1", "cut,entries=20", "zeroed", "flipped,entries=2"])
def test_what_a_medium_loses_at_the_end_costs_nobody_the_car(harm: str) -> None:
    durable = "no" if harm == "torn" else "yes"
    fault = parse_injection(f"crash:target=MR1,at_s=0,restart_s=5,write=24,durable={durable},journal={harm}")
    report = run_point(CampaignSettings(SITE, "journal", 3_600.0), FaultPoint(1, fault)).report
    assert report.verdict is RunVerdict.SERVED, report.why()


@pytest.mark.parametrize("harm", ["cut,entries=45", "unsealed", "foreign"])
def test_a_machine_that_cannot_rely_on_its_journal_holds_and_is_told_of(harm: str) -> None:
    fault = parse_injection(f"crash:target=MR1,at_s=0,restart_s=5,write=46,durable=yes,journal={harm}")
    report = run_point(CampaignSettings(SITE, "journal", 3_600.0), FaultPoint(1, fault)).report
    assert report.verdict is RunVerdict.HELD, report.why()
    assert report.halted == (), "it lives, and comes back by a person's word"


@pytest.mark.parametrize(
    ("target", "write", "harm"),
    [("MR1", 46, "unsealed"), ("MR1", 46, "foreign"), ("MR1", 40, "lost"), ("IOC1", 20, "lost")],
)
def test_a_person_who_comes_has_all_served_again_within_five_minutes(target: str, write: int, harm: str) -> None:
    text = f"crash:target={target},at_s=0,restart_s=5,write={write},durable=yes,journal={harm},person_s=40"
    report = run_point(CampaignSettings(SITE, "journal", 3_600.0), FaultPoint(1, parse_injection(text))).report
    assert report.verdict in GOOD, report.why()
    assert dict(report.recovery)[Measure.REPAIR_SERVES] < 300e6


@pytest.mark.parametrize(
    ("site", "text"),
    [
        pytest.param("small", "target=MR1,write=86,journal=lost", id="a robot aboard a lift"),
        pytest.param("level1", "target=MR1,write=1,journal=lost", id="a robot that had begun as in a first life"),
        pytest.param(
            "level1", "target=IOC1,write=43,journal=unsealed", id="a robot has the right to the car in the bay"
        ),
        pytest.param(
            "level1", "target=IOC1,write=94,journal=rolled_back,entries=50", id="a robot has the right to the bay"
        ),
        pytest.param(
            "level1", "target=IOC1,write=93,journal=rolled_back,entries=50", id="a car left since an old journal"
        ),
        pytest.param("level1", "target=IOC1,write=83,journal=rolled_back,entries=10", id="and is not said to be back"),
        pytest.param(
            "small", "target=IOC1,write=82,journal=cut,entries=43", id="a robot brings another car than is called"
        ),
    ],
)
def test_rights_that_are_made_anew_leave_nobody_waiting(site: str, text: str) -> None:
    """Harms 22745 and 3540 of `small`, 7869, 1277, 4263, 4204 and 3613 of `level1`, of three cars that overlap."""
    settings = CampaignSettings(site, "journal", 3_600.0, scene=SceneOccasion.OVERLAP)
    crash = parse_injection(f"crash:at_s=0,restart_s=5,durable=yes,person_s=40,{text}")
    report = run_point(settings, FaultPoint(1, crash)).report
    assert report.verdict in GOOD, report.why()


@pytest.mark.parametrize(
    ("site", "text"),
    [
        # The robot has lost the measure of a car that was called for unmeasured, and must not grip it so.
        ("small", "crash:target=MR1,at_s=0,restart_s=5,write=36,durable=yes,journal=cut,entries=19"),
        # The compartment has lost who drives in, but for the number, and his robot has its next task too.
        ("small", "crash:target=IOC1,at_s=0,restart_s=5,write=139,durable=yes,journal=cut,entries=5"),
        ("level1", "crash:target=IOC1,at_s=0,restart_s=5,write=31,durable=yes,journal=flipped,entries=1"),
    ],
)
def test_what_a_medium_loses_while_somebody_drives_in_leaves_nobody_waiting(site: str, text: str) -> None:
    """Harms 19878 and 6865 of `small`, 730 of `level1`, of three cars that overlap."""
    settings = CampaignSettings(site, "journal", 3_600.0, scene=SceneOccasion.OVERLAP)
    report = run_point(settings, FaultPoint(1, parse_injection(text))).report
    assert report.verdict is RunVerdict.SERVED, report.why()


@pytest.mark.parametrize(
    ("name", "seed", "text"),
    [
        # The robot aboard planned to come back: that ride was begun, and the gate went back and forth for minutes.
        pytest.param("small", 3, "target=ER1,at_s=59.13,journal=foreign", id="a lift that forgot a ride"),
        pytest.param("twin", 24, "target=MR1,at_s=85.48,journal=lost", id="a robot in the mouth between two alleys"),
    ],
)
def test_whatever_a_machine_was_in_the_midst_of_it_goes_on_from_there(name: str, seed: int, text: str) -> None:
    site = find_site(name)
    demand = simulated_of(site).usual(site, {"cars": 6, "orders": None, "apart": 30.0})
    crash = parse_injection(f"crash:restart_s=5,person_s=40,{text}")
    report = play(site, FaultScenario(name, seed, 3_600.0, demand, (crash,)))
    assert report.verdict is RunVerdict.SERVED, report.why()


def test_a_hold_is_over_with_its_life_and_with_its_epoch() -> None:
    """A robot whose disk was full for a while came back, and two minutes later the trial was over as told, unserved."""
    held = Held()

    def beat(boot: int, epoch: int = 0) -> Heartbeat:
        return Heartbeat(11, 1, 1, 0, boot, KindCode.ROBOT, MachineState.OBSTACLE, epoch)

    def halted(boot: int, reason: Reason = Reason.JOURNAL_LOST) -> Halted:
        return Halted(11, 11, reason, 0, True, boot)

    for number, word in enumerate([beat(1), halted(1), beat(1), halted(1)]):
        held.hear(word, number)
    assert held.is_over(HELD_US + 1), "since it was said first"
    held.hear(beat(2), 10)
    assert not held.is_over(HELD_US + 10), "another life"
    held.hear(halted(2, Reason.JOURNAL_SHORT), 11)
    assert held.is_over(HELD_US + 11), "that holds as well"
    held.hear(beat(2, epoch=1), 12)
    assert not held.is_over(HELD_US + 12), "its rights were made anew"

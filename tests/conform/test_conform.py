"""The kit of conformity: its sentences are the page's, our robot keeps to all, and what breaks a duty is named."""

import os
import re
import select
import signal
import threading
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

from onboard.cli import main as onboard
from onboard.conform.checks import Check, CheckResult, Findings, Verdict
from onboard.conform.cli import Bench
from onboard.conform.player import Player, Scene
from onboard.conform.report import NodeUnderTest, frame_words, junit, lines_of, protocol, status, totals
from onboard.conform.stage import Means, PlatformRun
from onboard.conform.suite import scenes_of, watchers_of
from onboard.contract.messages import Heartbeat
from onboard.core.negotiation.participant import Participant
from onboard.holon.holding import HoldResponse, MachineHolds
from onboard.holon.holon import Holon
from onboard.io.open_bus import BusSettings, open_bus
from onboard.systems.car_park.site import CarPark
from onboard.systems.car_park.travel import Carriage
from onboard.wire.codec import fleet_codec
from tests.conform.bench import ALL, SITE, SITES, play
from tests.foreign.life import Foreign
from tests.project.rows import ROOT
from tests.tools import DEADLINE_S

PAGE = ROOT / "docs" / "protocol.md"
BENCH = Path(__file__).parent / "bench.toml"
CHECKS: tuple[Check, ...] = (
    *(check for scene in scenes_of(SITE) for check in scene.checks),
    *(check for checks, _ in watchers_of(SITE) for check in checks),
)
#: Scenes that are played only where there is a second robot.
WITH_ANOTHER = [one for one in scenes_of(SITE) if one.needs_rival]
#: Scenes that are played only where there is a lift (test_lift.py).
WITH_A_LIFT = [one for one in scenes_of(SITE) if one.needs_lift]
SUBJECT = NodeUnderTest(
    11, "MR1", "robot", "bench", 0xABCD, 254, "onboard 0", "virtual bench", "2026-01-01T00:00:00+00:00"
)


@cache
def duties() -> dict[str, str]:
    """What stands under each number, on one line."""
    text = re.sub(
        r"<!-- (?:chart|times|example|made) .*?<!-- end -->", "", PAGE.read_text(encoding="utf-8"), flags=re.S
    )
    found = re.findall(r"(?:^- |\| )\[([A-Z]\d+)\] (.+?)(?=\n- \[|\n\| \d |\n\n|\Z)", text, re.S | re.M)
    return {name: " ".join(said.split()) for name, said in found}


def names(findings: Findings, verdict: Verdict) -> list[str]:
    return [one.check.name for one in findings.of(verdict)]


@cache
def ours() -> Player:
    return play()


# --- what is judged ----------------------------------------------------------------------------------------------


def test_each_check_names_a_sentence_that_stands_under_its_duty() -> None:
    wrong = [(one.name, one.duty) for one in CHECKS if one.sentence not in duties().get(one.duty, "")]
    assert wrong == []
    assert len(CHECKS) == len({one.name for one in CHECKS}) >= 150


def test_the_page_lists_the_duties_that_no_check_judges() -> None:
    page = (ROOT / "docs" / "conform.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| ([A-Z]\d+) \|", page, re.M)
    judged = {one.duty for one in CHECKS}
    assert listed == [one for one in duties() if one not in judged]
    assert f"{len(CHECKS)} checks" in page and f"{len(judged)} of {len(duties())} duties" in page


# --- who is judged -----------------------------------------------------------------------------------------------


def test_our_robot_keeps_to_all_of_it() -> None:
    findings = ours().findings
    broken = [line for one in findings.of(Verdict.FAILED) for line in lines_of(one, frame_words)]
    assert broken == [] and status(findings) == 0
    lacks = {f"the site has no {what} that the kit could speak as" for what in ("further robot", "lift")}
    elsewhere = {one.name for one in (*WITH_ANOTHER, *WITH_A_LIFT)}
    assert {one.scene for one in findings.of(Verdict.NOT_REACHED)} == elsewhere
    assert {one.why for one in findings.of(Verdict.NOT_REACHED)} == lacks


@pytest.mark.parametrize("site", SITES[1:3], ids=lambda one: one.name)
@pytest.mark.parametrize("scene", WITH_ANOTHER, ids=lambda one: one.name)
def test_our_robot_keeps_to_all_of_it_beside_another(scene: Scene, site: CarPark) -> None:
    findings = play((scene.name,), site=site).findings
    broken = [line for one in findings.of(Verdict.FAILED) for line in lines_of(one, frame_words)]
    reached = {one.check.name for one in findings.of(Verdict.PASSED)}
    assert broken == [] and {one.name for one in scene.checks} <= reached


@pytest.mark.parametrize("site", SITES[1:3], ids=lambda one: one.name)
def test_our_robot_keeps_to_the_whole_play_as_the_mutants_have_it(site: CarPark) -> None:
    """Each scene begins where the one before has left all: a check that fails only so would catch every mutant."""
    findings = play(site=site).findings
    assert [line for one in findings.of(Verdict.FAILED) for line in lines_of(one, frame_words)] == []


def test_without_a_switch_and_a_car_it_is_judged_as_far_as_it_can_be() -> None:
    findings = play(("bids", "another life", "parking"), means=Means()).findings
    assert findings.of(Verdict.FAILED) == []
    lacks = {one.scene: one.why for one in findings.of(Verdict.NOT_REACHED) if one.why}
    assert lacks == {
        "another life": "nobody switches the node off and on: --power",
        "parking": "no car stands in the bay: --car",
    }


@pytest.mark.parametrize("site", SITES[:3], ids=lambda one: one.name)
def test_the_robot_of_the_page_keeps_to_all_that_it_meets(site: CarPark) -> None:
    """Written from the page in another language (tests/foreign): alone, beside another and the other way round."""
    with Foreign() as robot:
        findings = play(site=site, joins=robot.joins).findings
    assert names(findings, Verdict.FAILED) == []
    is_alone = site is SITE
    unreached = {one.scene for one in findings.of(Verdict.NOT_REACHED)}
    assert unreached == {one.name for one in (*(WITH_ANOTHER if is_alone else ()), *WITH_A_LIFT)}


def test_who_is_not_there_does_not_conform() -> None:
    findings = play(("questions",), joins=lambda _: lambda _: None).findings
    assert names(findings, Verdict.PASSED) == [
        "no-plan-before-time",
        "leaves-questions-to-others",
        "stranger-gets-no-answer",
    ]
    assert status(findings) == 1


def test_a_robot_that_bids_though_it_is_beaten_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Participant, "_is_beaten", lambda _: False)
    broken = names(play(("others bid",)).findings, Verdict.FAILED)
    assert {"beaten-by-1-ms", "beaten-by-far", "equal-cost-of-a-lower-node-wins"} <= set(broken)


def test_a_robot_that_hears_no_stop_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MachineHolds, "stop", lambda *_: next(iter(HoldResponse)))
    findings = play(("emergency stop",)).findings
    assert "stop-is-obeyed" in names(findings, Verdict.FAILED) and status(findings) == 1


def test_a_robot_that_gives_back_before_it_says_where_it_is_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Carriage, "_after_place", lambda _, given, __, went=False: given)  # its name
    assert names(play(("parking",)).findings, Verdict.FAILED) == ["each-return-comes-behind-its-place"]


def test_a_robot_that_counts_a_drop_twice_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = Holon._all_drops
    monkeypatch.setattr(Holon, "_all_drops", lambda holon: counted(holon) + counted(holon))
    broken = names(play(("short frames", "no message at all")).findings, Verdict.FAILED)
    assert {"short-heartbeat-is-counted", "unknown-message-is-counted", "each-frame-of-a-flood-is-counted-once"} <= {
        *broken
    }


# --- what is told ------------------------------------------------------------------------------------------------


def judged() -> Findings:
    """One of each verdict."""
    findings = Findings()
    findings.add("a scene", tuple(Check(name, "J2", f"<{name}> & so on.") for name in ("kept", "broken", "away")))
    player = ours()
    word = player.stage.words[Heartbeat][0]
    shown = (player.stage.shown(word.frame, word.time_us),)
    findings.by_name["kept"].judge("", shown, is_kept=True)
    findings.by_name["broken"].judge("too <late>\x00", shown, is_kept=False)
    findings.by_name["away"].why = "no car"
    return findings


def test_junit_has_a_case_for_each_check() -> None:
    suite = ElementTree.fromstring(junit(judged(), SUBJECT, frame_words))
    assert {key: suite.get(key) for key in ("tests", "failures", "skipped")} == {
        "tests": "3",
        "failures": "1",
        "skipped": "1",
    }
    kept, broken, away = suite
    assert kept.get("name") == "kept [J2]" and kept.get("classname") == "a scene" and len(kept) == 0
    assert broken[0].tag == "failure" and "<broken> & so on." in (broken[0].text or "")
    assert "1250000B#" in (broken[0].text or "") and broken[0].get("message") == "too <late>?"
    assert away[0].tag == "skipped" and away[0].get("message") == "no car"


def test_the_protocol_has_all_that_is_signed() -> None:
    text = protocol(judged(), SUBJECT, frame_words)
    for part in ("11 (MR1, robot)", "bench, digest ABCD", "254", "2026-01-01", "| a scene | kept | J2 | passed |"):
        assert part in text
    assert "| away | J2 | not reached: no car |" in text and "[J2] <broken> & so on." in text
    assert text.count("signature: ____") == 2


def test_the_first_failure_stands() -> None:
    finding = CheckResult(CHECKS[0], "a scene")
    finding.judge("", (), is_kept=True)
    finding.judge("first", (), is_kept=False)
    finding.judge("second", (), is_kept=False)
    finding.judge("", (), is_kept=True)
    assert (finding.verdict, finding.why) == (Verdict.FAILED, "first")
    with pytest.raises(ValueError, match="two checks"):
        Findings().add("a scene", (CHECKS[0], CHECKS[0]))


MISTAKES = [
    (["--node", "12", "--kind", "robot"], "--node 12: no machine of site bench; it has 1 (IOC1), 11 (MR1), 21 (IOC2)"),
    (["--node", "11", "--kind", "lift"], "--kind lift: MR1 is a robot by the site file"),
    (["--node", "1", "--kind", "compartment"], "--kind compartment: only robots of a car park can be judged yet"),
    (["--node", "11", "--kind", "robot", "--scene", "biding"], "--scene biding: not known; --list tells all"),
    (["--node", "11", "--kind", "robot", "--power", "./nowhere"], "--power ./nowhere: no program that can be run"),
    (["--node", "11", "--kind", "robot", "--lift", "./nowhere"], "--lift ./nowhere: no program that can be run"),
    (["--node", "11", "--kind", "robot", "--junit", "/no/where.xml"], "/no/where.xml: No such file or directory; name"),
]


@pytest.mark.parametrize(
    ("site", "told"),
    [
        ("small", "--site small: it has ER1, ER2; one lift is played at most; take a smaller site"),
        (
            str(BENCH.with_name("lift.toml")),
            "--site lift: it has ER1; nobody moves its platform; name a program that does: --lift",
        ),
    ],
)
def test_a_site_with_two_lifts_or_a_platform_that_nobody_moves_is_refused(
    site: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["conform", "--node", "11", "--kind", "robot", "--site", site, "-i", "virtual", "-c", "none"]
    assert onboard(words) == 2
    assert capsys.readouterr().err == f"onboard conform: {told}\n"


async def test_what_moves_a_platform_is_told_lift_and_stop(tmp_path: Path) -> None:
    told, mover = tmp_path / "told", tmp_path / "mover"
    mover.write_text(f"#!/bin/sh\necho $@ >{told}\n", encoding="utf-8")
    mover.chmod(0o755)
    player = Player(SITES[3], 11, fleet_codec(), scenes_of(SITES[3])[:1], ALL)
    player.stage.rides.append(PlatformRun(5, 2, 1_000))
    bus = await open_bus(BusSettings(interface="virtual", channel="moved", bitrate=500_000))
    bench = Bench(player, bus, None, str(mover))
    assert bench.running is not None
    await bench.running
    await bench.end()
    await bus.close()
    assert told.read_text(encoding="utf-8") == "5 2\n"


@pytest.mark.parametrize(("words", "told"), MISTAKES)
def test_a_mistake_is_one_line_with_the_remedy(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert onboard(["conform", *words, "-i", "virtual", "-c", "none", "--site", str(BENCH)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and told in error


def test_the_list_tells_all_checks_and_needs_no_bus(capsys: pytest.CaptureFixture[str]) -> None:
    assert onboard(["conform", "--list", "--node", "11", "--kind", "robot", "--site", str(BENCH)]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(CHECKS)


def test_the_player_takes_up_frames_and_times_only() -> None:
    """No bus: whoever calls it says what time it is, and what it is to hear."""
    player = Player(SITE, 11, fleet_codec(), scenes_of(SITE)[:1], ALL, watchers_of(SITE))
    player.start(1_000)
    assert player.stage.power == [False] and player.stage.out == []
    player.wake(player.next_us())
    while not player.stage.out:
        player.wake(player.next_us())
    assert player.stage.now_us == 1_006_000 and player.stage.power == [False, True]
    assert totals(player.findings).startswith(f"{len(player.findings.by_name)} checks: 0 passed, 0 failed")


def test_what_switches_the_node_does_not_outlive_the_play(tmp_path: Path) -> None:
    """The switch takes its time, a supervisor ends the play meanwhile: no process is left behind."""
    begun, switch = tmp_path / "begun", tmp_path / "switch"
    os.mkfifo(begun)
    switch.write_text(f"#!/bin/sh\necho $$ >{begun}\nexec sleep 300\n", encoding="utf-8")
    switch.chmod(0o755)
    switches: list[int] = []

    def end() -> None:
        switches.append(os.pidfd_open(int(begun.read_text(encoding="utf-8"))))
        os.kill(os.getpid(), signal.SIGTERM)

    person = threading.Thread(target=end)
    person.start()
    words = ["--node", "11", "--kind", "robot", "--site", str(BENCH), "-i", "virtual", "-c", "ended"]
    assert onboard(["conform", *words, "--power", str(switch)]) == 1
    person.join()
    assert select.select(switches, [], [], DEADLINE_S)[0], "it switches on"
    os.close(switches[0])

"""A machine that is due again at once, whatever is done, halts with a reason and ends a simulated run by its name."""

import signal
from pathlib import Path

import pytest

from bus_sim.campaign.limits import WallLimitError, wall_limit
from bus_sim.campaign.report import FAILURES, RunVerdict
from bus_sim.campaign.trial import play
from bus_sim.cli import main
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import NoWatchdog
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.virtual_time import EventLimitError, StandstillError, VirtualTimeLoop
from onboard.controller.rest import MOST_WAKES, Rest

RESTLESS = "onboard.systems.car_park.robot.ParkingRobot.next_wake"
SCENE = FaultScenario("level1", 1, 600.0, Arrivals(1, 5.0, 1.0, 60.0))


def test_a_clock_that_goes_on_does_not_hide_that_a_machine_never_rests() -> None:
    """On a board each wake comes later; what counts is that it leaves the next one due no later than itself."""
    rest = Rest()
    for number in range(MOST_WAKES):
        assert not rest.is_broken
        rest.woke(1_000 + number)
        rest.due(900)
    assert rest.is_broken
    assert "come to rest" in rest.why


def test_a_machine_that_is_late_but_goes_on_is_left_alone() -> None:
    rest = Rest()
    for number in range(10 * MOST_WAKES):
        rest.woke(1_000 * number)
        rest.due(1_000 * number + 1)
    assert not rest.is_in_doubt


def test_a_run_ends_with_the_machine_that_does_not_rest(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(RESTLESS, lambda _: 0)
    fed: list[int] = []
    monkeypatch.setattr(NoWatchdog, "alive", lambda _: fed.append(1))
    words = "run level1 --one-car 60 --speed max --no-web --trace"
    assert main([*words.split(), str(tmp_path / "run.log")]) == 1
    assert "HALTED       MR1: the machine's wakes do not come to rest" in capsys.readouterr().out
    assert len(fed) < MOST_WAKES // 2, "its supervisor is told of no progress"


def test_a_trial_that_hangs_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RESTLESS, lambda _: 0)
    report = play(find_site("level1"), SCENE)
    assert report.verdict is RunVerdict.HUNG
    assert report.verdict in FAILURES
    assert report.halted[0].startswith("MR1: the machine's wakes")


def test_a_trial_that_goes_on_ever_slower_runs_into_its_events(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bus_sim.campaign.trial.event_limit", lambda _: 500)
    report = play(find_site("level1"), SCENE)
    assert (report.verdict, "500 events are over" in report.why()) == (RunVerdict.HUNG, True)
    assert play(find_site("level1"), SCENE) == report, "the same on every machine"


def test_a_decision_that_never_ends_is_torn_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def for_ever(_: object) -> None:
        while True:
            pass

    monkeypatch.setattr(RESTLESS, for_ever)
    monkeypatch.setattr("bus_sim.campaign.trial.wall_limit_s", lambda _: 0.2)
    report = play(find_site("level1"), SCENE)
    assert (report.verdict, "of the wall" in report.why()) == (RunVerdict.HUNG, True)


def test_a_limit_that_is_kept_leaves_no_alarm_behind() -> None:
    with wall_limit(1000.0):
        pass


def test_a_limit_that_is_over_before_anything_is_done_leaves_none_either() -> None:
    """It was set outside of what takes it away, and fell into whatever came five seconds later."""

    def for_ever() -> None:
        while True:
            pass

    with pytest.raises(WallLimitError), wall_limit(1e-6):
        for_ever()
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_timers_at_one_moment_for_ever_end_the_loop_with_a_name() -> None:
    loop = VirtualTimeLoop()

    def again(now_us: int) -> None:
        loop.at_us(now_us, again)

    loop.at_us(5, again)
    try:
        with pytest.raises(StandstillError, match=r"0\.000005 s.*again"):
            loop.run_forever()
    finally:
        loop.close()


def test_what_is_ready_for_ever_ends_the_loop_with_a_name() -> None:
    loop = VirtualTimeLoop()

    def again() -> None:
        loop.call_soon(again)

    loop.call_soon(again)
    try:
        with pytest.raises(StandstillError, match="again"):
            loop.run_forever()
    finally:
        loop.close()


def test_a_loop_counts_its_events() -> None:
    loop = VirtualTimeLoop()
    loop.event_limit = 3
    for number in range(5):
        loop.at_us(number, lambda _: None)
    try:
        with pytest.raises(EventLimitError):
            loop.run_forever()
        assert loop.events == 4
    finally:
        loop.close()

"""How long the fleet needs to get over a fault, looked at from outside, and whether it converges at all."""

from pathlib import Path

import pytest

from bus_sim.campaign.recovery import Measure, healed_us
from bus_sim.campaign.report import RunVerdict, TrialReport
from bus_sim.campaign.trial import play
from bus_sim.cli import main
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.car_park.planted.registry import BUGS
from bus_sim.systems.car_park.simulation import Simulation


def trial(*faults: str, cars: int = 1, limit_s: float = 1_200.0) -> TrialReport:
    """One car on the small site, with these faults."""
    injections = tuple(parse_injection(fault) for fault in faults)
    return play(find_site("small"), FaultScenario("small", 1, limit_s, Arrivals(cars, 20.0, 1.0, 100.0), injections))


def times_s(report: TrialReport) -> dict[str, float]:
    return {measure: us / 1e6 for measure, us in report.recovery}


def test_without_faults_there_is_nothing_to_get_over() -> None:
    report = trial()
    assert (report.verdict, report.recovery) == (RunVerdict.SERVED, ())


def test_a_machine_that_falls_silent_is_missed_after_three_heartbeats() -> None:
    report = trial("crash:target=ER1,at_s=40,restart_s=20")
    times = times_s(report)
    assert 4.0 <= times[Measure.LOSS_NOTICED] <= 6.2, "heartbeats come every two seconds"
    assert 0.0 < times[Measure.RESTART_ADMITTED] < 15.0
    assert Measure.HEAL_DIGESTS in times


#: What a crash falls into; taking part took 6 to 8.1 s in the first three before, and equal mirrors 18.7 s in the last.
AMID = {
    "a stroke of the shuttle, which goes on without its controller": "MR1,at_s=168.2",
    "a run between two marks": "MR1,at_s=101.5",
    "a run across the sill of a lift": "MR1,at_s=104.4",
    "a car's token is the robot's, which has not moved it yet": "IOC1,at_s=168.2",
}


@pytest.mark.parametrize("amid", AMID)
def test_whatever_a_restart_falls_into_the_machine_takes_part_and_all_know_the_same_soon(amid: str) -> None:
    report = trial(f"crash:target={AMID[amid]},restart_s=0.5")
    times = times_s(report)
    assert report.verdict is RunVerdict.SERVED
    assert times[Measure.RESTART_ADMITTED] <= 4.0
    assert times[Measure.HEAL_DIGESTS] <= 1.0


def test_a_machine_off_the_bus_works_again_soon_after_the_cause_is_gone() -> None:
    times = times_s(trial("bus_off:target=MR1,at_s=40,for_s=2.5"))
    assert 0.0 < times[Measure.BUS_OFF_WORKING] < 2.5, "its next heartbeat at the latest"


def test_a_machine_that_stays_dead_is_not_waited_for() -> None:
    report = trial("crash:target=ER2,at_s=40,restart=no")
    assert (report.verdict, report.is_apart) == (RunVerdict.SERVED, False)


def test_a_machine_that_is_off_for_long_is_waited_for() -> None:
    """All were served before it came back, and that it knew nothing by then was called not converged."""
    report = trial("crash:target=ER2,at_s=40,restart_s=700")
    assert (report.verdict, report.is_apart) == (RunVerdict.SERVED, False)
    assert report.simulated_s >= 740


def test_all_faults_are_over_with_the_last_of_them() -> None:
    texts = ["burst:at_s=5,for_s=2", "power_cut:at_s=6,for_s=10,spread_s=4", "cancel:car=1,at_s=9", "lost_ticket:car=1"]
    assert healed_us(parse_injection(text) for text in texts) == 20_000_000
    assert healed_us([parse_injection("omission:until_us=77,probability=0.5")]) == 77


def test_what_stands_still_while_faults_last_is_no_failure_but_what_does_so_afterwards_is() -> None:
    """The only robots' drives hear no order, so an open task goes nowhere for longer than anybody may wait."""
    stuck = [f"actuator_stuck:target={name},at_s=25,for_s={{}}" for name in ("MR1", "MR2")]
    healing = trial(*(text.format(400) for text in stuck))
    assert healing.stalls == ()
    # A robot that finds its drive stuck gives its task back, so the customer may be turned away with a word.
    assert healing.verdict in (RunVerdict.SERVED, RunVerdict.DELAYED, RunVerdict.TOLD)


FROZEN = "clock_frozen:target=IOC1|MR1,at_s=15,for_s=10"


def test_who_is_served_too_late_after_clocks_are_right_is_a_finding(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Five minutes are the bar of issue 13; here it is five seconds, as the shipped code keeps it."""
    scenario = FaultScenario("level1", 1, 1_200.0, Arrivals(1, 5.0, 1.0, 100.0), (parse_injection(FROZEN),))
    kept = play(find_site("level1"), scenario)
    assert kept.verdict is RunVerdict.SERVED
    took_s = times_s(kept)[Measure.HEAL_SERVED]
    assert 5.0 < took_s < 300.0
    for module in ("trial", "report"):
        monkeypatch.setattr(f"bus_sim.campaign.{module}.SERVED_AGAIN_US", 5_000_000)
    late = play(find_site("level1"), scenario)
    assert late.verdict is RunVerdict.LATE
    assert late.why() == f"all are served {took_s:.0f} s after the clocks were right, not within 5 s"
    file = tmp_path / "late.toml"
    file.write_text(scenario.to_toml(), encoding="utf-8")
    assert main(["run", "--scenario", str(file)]) == 1


def test_the_bar_after_wrong_clocks_is_not_for_runs_with_other_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bus_sim.campaign.trial.SERVED_AGAIN_US", 5_000_000)
    faults = tuple(parse_injection(one) for one in (FROZEN, "pause:target=MR1,at_s=16,for_s=5"))
    report = play(find_site("level1"), FaultScenario("level1", 1, 1_200.0, Arrivals(1, 5.0, 1.0, 100.0), faults))
    assert times_s(report)[Measure.HEAL_SERVED] > 5.0
    assert report.verdict is RunVerdict.SERVED


def test_a_trial_hears_what_the_checkers_find(monkeypatch: pytest.MonkeyPatch) -> None:
    """A planted bug that the plant's oracle does not see, because nothing collides."""

    def plant(simulation: Simulation, _: object) -> None:
        BUGS["custody-first"].plant(simulation)

    monkeypatch.setattr("bus_sim.campaign.trial.arm", plant)
    report = trial(cars=2)
    assert report.verdict is RunVerdict.VIOLATION
    assert "one-custodian" in report.violations[0]

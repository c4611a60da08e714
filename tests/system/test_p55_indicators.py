"""Row P55 on real runs: figures against the run's own frames and plant, and a window of a day shown by itself."""

import json
import re
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from bus_sim.cli import build_parser
from bus_sim.cli import main as bus_sim
from bus_sim.options import RunOptions
from bus_sim.session import run_site
from bus_sim.sites import find_site
from bus_sim.systems.car_park.bay_times import BayTimes, bay_lines
from bus_sim.systems.car_park.day import ParkingDay
from bus_sim.systems.car_park.summary import RunSummary
from onboard.contract.codes import CallResult, DoorPosition, Operation, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, DoorState, Progress, TaskReport
from onboard.contract.runs import singles
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.indicators import FleetIndicators, Indicators
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.sites import at_the_key, one_floor
from tests.system.scene import Scene, play, stays


@pytest.fixture(scope="module")
def run() -> tuple[Scene, FleetIndicators]:
    """Three cars in, two out, on one floor."""
    site = at_the_key(one_floor())
    indicators = Indicators(site)
    scene = play(
        site,
        stays((0, 400), (60, 700), (500, None)),
        before=lambda simulation: simulation.observers.append(indicators.feed),
    )
    scene.assert_sound()
    return scene, indicators.figures(scene.simulation.loop.now_us())


def test_p55_the_bus_tells_what_happened_in_the_plant(run: tuple[Scene, FleetIndicators]) -> None:
    scene, figures = run
    summary = scene.simulation.plant.street.summary()
    assert (figures.parked.count, figures.fetched.count) == (summary.parked, summary.served) == (3, 2)
    assert figures.tasks == figures.calls == 5
    assert figures.bids == len(scene.all(Bid, "fleet"))
    assert figures.messages["CallForProposals"] == len(scene.all(CallForProposals, "fleet"))
    # The oracle's body moved as far as the robot said.
    position_mm, _ = scene.simulation.plant.world.robots[11].motion.at(scene.simulation.loop.now_us())
    steps = [(p.index - 1) * 2400 + p.offset_mm for _, p in scene.all(Progress, "fleet") if p.sender == 11]
    assert abs(steps[-1] - position_mm) <= 5
    walked_mm = sum(abs(after - before) for before, after in pairwise(steps))
    assert figures.robots_travel_mm == walked_mm > 20_000
    assert 0 < figures.robots_empty_mm < walked_mm


def test_p55_the_robots_time_adds_up_and_its_tasks_last_as_the_frames_say(run: tuple[Scene, FleetIndicators]) -> None:
    scene, figures = run
    (robot,) = figures.machines
    assert robot.riding + robot.driving + robot.handling + robot.standing + robot.idle == pytest.approx(1)
    awards = {award.task: time_us for time_us, award in scene.all(Award) if award.result is CallResult.AWARDED}
    ends = {report.task: time_us for time_us, report in scene.all(TaskReport) if report.phase is TaskPhase.DONE}
    # One robot and no task called before the last was done: the times with a task do not overlap.
    with_task_s = sum(ends[task] - awards[task] for task in ends) / 1e6
    assert robot.with_task * figures.seconds_s == pytest.approx(with_task_s, abs=0.1)
    assert robot.handling > robot.driving > 0


def test_p55_promises_are_compared_with_the_end_that_the_bus_saw(run: tuple[Scene, FleetIndicators]) -> None:
    scene, figures = run
    calls = {(call.sender, call.call): call for _, call in scene.all(CallForProposals)}
    costs = {calls[bid.initiator, bid.call].task: bid.cost for _, bid in scene.all(Bid, "fleet")}
    ends = {report.task: time_us for time_us, report in scene.all(TaskReport) if report.phase is TaskPhase.DONE}
    slack_s = sorted(costs[task] / 1000 - ends[task] / 1e6 for task in ends)
    assert figures.slack.count == 5
    assert figures.slack.worst_s == pytest.approx(slack_s[0], abs=0.01)
    assert figures.slack.mean_s == pytest.approx(sum(slack_s) / 5, abs=0.01)


def test_p55_any_log_of_the_fleet_bus_gives_the_same_figures(tmp_path: Path) -> None:
    trace = tmp_path / "trace.log"
    site = replace(car_park(find_site("small")), rides=RideCalls.BEFORE)
    day = ParkingDay(random_s=(120.0, 30.0), cars=3)
    summary = run_site(site, RunOptions(demand=day, limit_s=600, trace=trace, quiet=True))
    assert isinstance(summary, RunSummary)
    with trace.open("rb") as lines:
        records = list(CandumpReader(lines))
    epoch_us = 946_684_800_000_000 - 10_000_000 + summary_first_us(site)
    indicators, decoder = Indicators(site, epoch_us), Decoder(fleet_codec())
    for record in records:
        message = decoder.feed(record.frame, record.time_us)
        for word in singles(message) if message is not None else ():
            indicators.feed(word, record.time_us)
    found = indicators.figures(epoch_us + round(summary.simulated_s * 1e6))
    assert found == summary.fleet
    assert found.tasks >= 2 and found.sub_calls > 0
    lifts = [machine for machine in found.machines if machine.machine.startswith("ER")]
    assert sum(lift.riding + lift.handling for lift in lifts) > 0 and all(lift.with_task > 0 for lift in lifts[:1])
    rides = [call for call in calls_of(records) if call.operation is Operation.RIDE]
    assert len(rides) == found.sub_calls


def summary_first_us(site: object) -> int:
    """The first arrival of the run above, us after its time zero."""
    from bus_sim.systems.car_park.demand import Demand

    return Demand.by_mean(120.0, 30.0, 1, count=3).stays[0].arrival_us


def calls_of(records: list) -> list[CallForProposals]:  # type: ignore[type-arg]  # records of a log
    decoder = Decoder(fleet_codec())
    found = [decoder.feed(record.frame, record.time_us) for record in records]
    return [message for message in found if isinstance(message, CallForProposals)]


# --- a window of a day ---------------------------------------------------------------------------------------------


def test_p55_a_windows_figures_are_apart_from_the_warm_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Level 1 from 06:20 to 06:50: the customers of that half hour, as the file of the day has them."""
    figures = tmp_path / "figures.json"
    status = bus_sim(
        ["run", "level1", "--window", "06:20-06:50", "--speed", "max", "--json", str(figures),
         "--trace", str(tmp_path / "trace.log")]
    )  # fmt: skip
    shown = capsys.readouterr().out
    assert status == 0, shown
    assert "warm-up from 05:58:50 to 06:20:00, as fast as possible: 7 cars come before" in shown
    found = json.loads(figures.read_text())
    assert found["window"] == "2019-07-24 06:20 to 06:50"
    assert found["simulated_s"] == pytest.approx(1_800, abs=1)
    assert found["cars_in"] == found["wait_in"]["count"] == found["fleet"]["parked"]["count"] == 7
    assert found["inside"] == 14
    assert found["burst"]["begins"] == "06:23:23" and found["burst"]["count"] == found["burst"]["wait_in"]["count"] == 5
    lines = (tmp_path / "trace.log").read_text().splitlines()
    in_window = [line for line in lines if float(line[1:18]) >= 1_563_974_400]
    assert found["frames"] == pytest.approx(len(in_window), abs=2) and len(in_window) < 0.6 * len(lines)
    assert re.search(r"^MR1 +\d+\.\d%( +\d+\.\d%){5} +\d+ +\d+% +\d+\.\d", shown, re.MULTILINE)


def test_without_a_terminal_a_window_is_told_line_by_line_at_its_pace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    started_s = time.monotonic()
    status = bus_sim(
        ["run", "level1", "--window", "06:20-06:30", "--speed", "300", "--trace", str(tmp_path / "trace.log")]
    )
    assert status == 0
    assert time.monotonic() - started_s >= 2.0, "ten minutes at 300 times real time"
    shown = capsys.readouterr().out
    assert "at speed 300.0" in shown
    assert [line[:8] for line in shown.splitlines() if re.match(r"06:2", line)] == ["06:20:01", "06:25:00"]


def options_of(*words: str, monkeypatch: pytest.MonkeyPatch) -> tuple[str, RunOptions]:
    """What ``bus-sim run`` with these words would play: the site's name and the options."""
    taken: list[tuple[str, RunOptions]] = []

    class Enough(BaseException):
        """Raised instead of a run."""

    def take(site: object, options: RunOptions) -> None:
        taken.append((getattr(site, "name", ""), options))
        raise Enough

    monkeypatch.setattr("bus_sim.run_command.run_site", take)
    with pytest.raises(Enough):
        bus_sim(["run", *words])
    return taken[0]


@pytest.mark.parametrize(
    ("words", "site", "window", "speed"),
    [
        ((), "standard", "two-way", 60.0),
        (("--speed", "max"), "standard", "two-way", None),
        (("--speed", "600"), "standard", "two-way", 600.0),
        (("level1",), "level1", None, None),
        (("standard",), "standard", None, None),
        (("standard", "--hour", "16:30"), "standard", "16:30", 60.0),
        (("level1", "--window", "06:00-07:30"), "level1", "06:00-07:30", 60.0),
        (("--one-car", "60"), "standard", None, None),
        (("--serve",), "standard", None, 1.0),
        (("--hour", "busiest", "--serve"), "standard", "busiest", 1.0),
        (("--for", "60"), "standard", None, None),
    ],
)
def test_what_is_played_where_little_is_said(
    words: tuple[str, ...], site: str, window: str | None, speed: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, options = options_of(*words, monkeypatch=monkeypatch)
    assert (name, options.demand.window, options.speed) == (site, window, speed)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--hour", "7"], "--hour 7: no time of day; write an hour as 06:30, busiest or two-way"),
        (["--hour", "06:30-07:30"], "--hour 06:30-07:30: one time of day"),
        (["--window", "06:30"], "--window 06:30: must be FROM-TO"),
        (["--speed", "quick"], "--speed quick: not a number"),
        (["--speed", "inf"], "--speed inf: must be above 0, or max"),
        (["--day", "2019-07-25..2019-07-24"], "the last day is before the first"),
        (["--day", "2019-07-24..soon"], "not a day; write it as 2019-07-24, several as"),
        (["--serve", "here"], "--serve here: must be HOST:PORT"),
        (["level1", "--web", "99999"], "--web 99999: must be PORT or HOST:PORT"),
        (["level1", "--random", "0", "1"], "--random: mean 0 s: must be above 0"),
        (["level1", "--random", "9", "1", "--cars", "-1"], "--cars -1: must be from 0 to 100000"),
        (["level1", "--one-car", "-5"], "--one-car -5: must be seconds from 0 to 1000000"),
        (["--serve", "127.0.0.1:0", "--without", "MR1", "--hour", "07:00"], "--without MR1: a window's warm-up"),
    ],
)  # fmt: skip
def test_a_mistake_about_the_window_gets_one_line(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert bus_sim(["run", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and told in error
    assert list(tmp_path.iterdir()) == []


def test_the_help_names_the_window_and_its_default() -> None:
    text = build_parser().format_help()
    assert "an hour of a real day on the standard site" in text


def test_who_waits_at_the_end_of_a_window_is_no_failure_but_at_the_end_of_a_day_is() -> None:
    options = RunOptions(demand=ParkingDay(one_car_s=3_600.0), limit_s=15, quiet=True)
    summary = run_site(find_site("level1"), options)
    assert isinstance(summary, RunSummary)
    assert summary.unserved + summary.cars_in <= 1
    assert not replace(summary, unserved=1).is_good
    assert replace(summary, unserved=1, window="06:00 to 07:00").is_good
    assert not replace(summary, window="06:00 to 07:00", violations=("two bodies",)).is_good


def test_a_run_that_was_ended_at_once_has_no_figures_and_no_line_is_wider_than_the_terminal() -> None:
    summary = run_site(find_site("level1"), RunOptions(demand=ParkingDay(one_car_s=60.0), quiet=True))
    assert isinstance(summary, RunSummary)
    assert replace(summary, simulated_s=0.5).lines() == ["site level1, seed 1: ended in its first second; no figures"]
    folded = summary.lines(80)
    assert max(map(len, folded)) <= 80 < max(map(len, summary.lines()))
    assert " ".join(" ".join(folded).split()) == " ".join(" ".join(summary.lines()).split())
    head = next(line for line in folded if line.startswith("machine"))
    assert "max wait s" in head, "the table is not folded"


def test_each_compartments_time_is_told_by_what_holds_its_bay() -> None:
    times: list[BayTimes] = []
    scene = play(
        one_floor(),
        stays((0, 400), (5, 700), (702, None)),
        before=lambda simulation: times.append(BayTimes(simulation.plant)),
    )
    (bay,) = times[0].figures()
    seconds = scene.simulation.loop.now_us() / 1e6
    assert (bay.cars_in, bay.cars_out) == (3, 2)
    assert bay.free + bay.person + bay.door + bay.shuttle + bay.robot == pytest.approx(1)
    # The output door is the shuttle's as long as it stands open, by its own word.
    opened_s, since_us = 0.0, 0
    for time_us, doors in scene.all(DoorState):
        if since_us:
            opened_s += (time_us - since_us) / 1e6
        since_us = time_us if doors.output_door is DoorPosition.OPEN else 0
    assert bay.shuttle * seconds == pytest.approx(opened_s, abs=0.1) and opened_s > 60
    # Others wait outside until the car before theirs is gone; each owner asks until the car is there.
    streets = [customer.visit for customer in scene.simulation.plant.street.customers]
    asked_s = sum(visit.out_wait_us or 0 for visit in streets) / 1e6
    queued_s = sum(visit.in_wait_us or 0 for visit in streets[1:]) / 1e6
    assert bay.queue_most == 1 and 30 < bay.queue_mean * seconds < queued_s
    assert bay.asking_most == 1 and asked_s - 80 < bay.asking_mean * seconds < asked_s
    # It was free for hours while nobody could use it, and never for long while somebody could.
    assert bay.free > 0.5 and bay.idle == 0
    # The third finds it locked for the second, until its robot is there.
    locked_us, _ = scene.first(DoorState, lambda one: one.input_door is DoorPosition.LOCKED, after_us=712_000_000)
    opened_us, _ = scene.first(DoorState, lambda one: one.output_door is DoorPosition.OPENING, after_us=712_000_000)
    assert bay.kept * seconds == pytest.approx((opened_us - locked_us) / 1e6, abs=1) and bay.kept < bay.robot
    assert bay_lines((bay,))[1].startswith(f"{bay.compartment} ")

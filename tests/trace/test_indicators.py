"""Performance indicators (row P55) against sequences of messages written by hand: every number is known beforehand."""

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import (
    CallResult,
    Criterion,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Operation,
    Reason,
    Side,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    CarAt,
    Heartbeat,
    Itinerary,
    Leg,
    Message,
    Progress,
    Reference,
    Stamp,
    TaskReport,
    Waiting,
)
from onboard.systems.car_park.site import car_park
from onboard.trace.durations import Durations, percentile
from onboard.trace.indicators import FleetIndicators, Indicators, Utilisation

SITE = car_park(find_site("small"))
BAY, ROBOT, OTHER, LIFT = 1, 11, 12, 5
LIFT_TRACK = next(track for track in SITE.lifts if SITE.stewards[track] == LIFT)
TASK = Reference(BAY, 1)
S = 1_000_000


def call(number: int = 1, *, task: Reference = TASK, operation: Operation = Operation.PARK, **other: int) -> Message:
    terms = {"attempt": 1, "depth": 0} | other
    return CallForProposals(
        BAY, number, task, operation, KindCode.ROBOT, Criterion.FINISH_TIME, terms["attempt"], terms["depth"],
        1_000, ANY_STATION, ANY_STATION, task, 2700,
    )  # fmt: skip


def award(number: int = 1, *, result: CallResult = CallResult.AWARDED, task: Reference = TASK) -> Message:
    winner = ROBOT if result is CallResult.AWARDED else 0
    return Award(BAY, number, winner, task, 1, result, Reason.NONE)


def plan(version: int, *legs: Leg, sender: int = ROBOT, call_number: int = 1, award_ms: int = 1_000) -> Message:
    return Itinerary(sender, version, Grade.FIRM, Stamp(award_ms, BAY, call_number), legs)


def go(track: int, begin: int, end: int, end_ms: int = 0) -> Leg:
    return Leg(LegAction.TRAVEL, track, begin, end, Side.NEAR, end_ms)


def work(track: int, index: int, end_ms: int = 0) -> Leg:
    return Leg(LegAction.WORK, track, index, index, Side.NEAR, end_ms)


def ride(begin: int, end: int) -> Leg:
    return Leg(LegAction.RIDE, LIFT_TRACK, begin, end, Side.NEAR, 0)


def at(index: int, speed_mm_s: int = 0, *, track: int = 2, sender: int = ROBOT, offset_mm: int = 0) -> Message:
    return Progress(sender, 1, 0, track, index, offset_mm, speed_mm_s)


def report(phase: TaskPhase, task: Reference = TASK, sender: int = ROBOT) -> Message:
    return TaskReport(sender, task, phase, 0, Reason.NONE)


def fold(*said: tuple[float, Message], until_s: float, begin_s: float | None = None) -> FleetIndicators:
    """Messages at their times in s, measured from ``begin_s`` on."""
    indicators = Indicators(SITE)
    for number, (time_s, message) in enumerate(said):
        if begin_s is not None and time_s >= begin_s and (number == 0 or said[number - 1][0] < begin_s):
            indicators.begin(round(begin_s * S))
        indicators.feed(message, round(time_s * S))
    return indicators.figures(round(until_s * S))


def machine(figures: FleetIndicators, name: str = "MR1") -> Utilisation:
    return next(machine for machine in figures.machines if machine.machine == name)


def test_p55_a_robots_time_is_split_into_what_it_does() -> None:
    figures = fold(
        (0, at(3)),
        (10, call()),
        (12, award()),
        (12, plan(2, go(2, 3, 6), work(2, 6), go(2, 6, 8), work(2, 8))),
        (20, at(3, 500)),
        (30, at(6)),
        (30.5, report(TaskPhase.STARTED)),
        (40, CarAt(ROBOT, TASK, ANY_STATION, 2, 2700)),
        (41, report(TaskPhase.LOADED)),
        (45, at(6, 500)),
        (50, at(8)),
        (58, CarAt(5, TASK, 0x208, 3, 2700)),
        (59, report(TaskPhase.DONE)),
        until_s=100,
    )
    robot = machine(figures)
    assert robot.with_task == pytest.approx(0.47), "from the award at 12 to the end at 59"
    assert robot.driving == pytest.approx(0.15)
    assert robot.handling == pytest.approx((41 - 30 + 59 - 50) / 100)
    assert robot.standing == pytest.approx((20 - 12 + 45 - 41) / 100)
    assert robot.riding == 0
    assert robot.idle == pytest.approx(0.53)
    assert (robot.travel_mm, robot.empty_mm) == (5 * 2400, 3 * 2400)
    assert robot.empty_share == pytest.approx(0.6)
    assert figures.robots_empty_share == pytest.approx(0.6)
    assert machine(figures, "MR2").idle == 1


def test_p55_driving_towards_lower_positions_is_driving_too() -> None:
    figures = fold(
        (0, at(6)), (10, call()), (12, award()), (12, plan(2, go(2, 6, 3))), (20, at(6, -500)), (30, at(3)), until_s=40
    )
    assert machine(figures).driving == pytest.approx(10 / 40)


def test_p55_riding_counts_for_the_robot_and_the_lift_by_the_robots_word() -> None:
    figures = fold(
        (0, at(1)),
        (0, Progress(LIFT, 0, 0, LIFT_TRACK, 2, 0, 0)),
        (10, plan(2, go(2, 1, 0), ride(2, 1), go(1, 0, 2))),
        (20, at(1, 500)),
        (30, at(0)),
        (40, Progress(LIFT, 0, 0, LIFT_TRACK, 2, 0, 300)),
        (50, Progress(LIFT, 0, 0, LIFT_TRACK, 1, 0, 0)),
        (55, at(0, track=1)),
        (60, at(0, 500, track=1)),
        (65, at(1, 500, track=1)),
        (70, Progress(LIFT, 0, 0, LIFT_TRACK, 1, 0, 300)),
        (80, Progress(LIFT, 0, 0, LIFT_TRACK, 3, 0, 0)),
        until_s=100,
    )
    robot, lift = machine(figures), machine(figures, "ER1")
    assert robot.riding == pytest.approx(0.30), "on the platform from 30 to 60"
    assert lift.with_task == pytest.approx(0.55), "from the plan at 10 until the robot has left at 65"
    assert lift.standing == pytest.approx(0.20)
    assert lift.handling == pytest.approx((40 - 30 + 65 - 50) / 100)
    assert lift.riding == pytest.approx(0.10)
    assert lift.driving == pytest.approx(0.10)
    pitch_mm = SITE.tracks[LIFT_TRACK].pitch_mm
    assert (lift.travel_mm, lift.empty_mm) == (3 * pitch_mm, 2 * pitch_mm)


def test_p55_the_longest_wait_ends_with_the_next_motion_not_with_the_next_word() -> None:
    waiting = Waiting(ROBOT, 2, 5, OTHER, Reason.TOKEN_HELD_BY_OTHER)
    figures = fold(
        (0, at(4)), (10, waiting), (12, at(4)), (14, waiting), (25, at(4, 200)), (26, at(5)), (40, waiting),
        (43, at(5, 300)), until_s=50,
    )  # fmt: skip
    assert machine(figures).longest_wait_s == pytest.approx(15)
    assert machine(fold((0, at(4)), (10, waiting), until_s=70)).longest_wait_s == pytest.approx(60), "still waiting"


def test_p55_calls_bids_and_messages_are_told_for_each_task() -> None:
    other = Reference(BAY, 2)
    figures = fold(
        (0, BusTime(BAY, 0)),
        (0, Heartbeat(ROBOT, 1, 2, 3, 4, KindCode.ROBOT, MachineState.IDLE)),
        (1, call(1)),
        (2, award(1, result=CallResult.REOPENED)),
        (3, call(2, attempt=2)),
        (3.1, Bid(OTHER, BAY, 2, 60_000, 0)),
        (3.2, Bid(ROBOT, BAY, 2, 50_000, 0)),
        (4, award(2)),
        (4.1, award(2)),
        (5, call(3, operation=Operation.RIDE, depth=1)),
        (40, report(TaskPhase.DONE)),
        (41, report(TaskPhase.DONE)),
        (50, call(4, task=other, operation=Operation.RETRIEVE)),
        (51, award(4, task=other)),
        (80, report(TaskPhase.DONE, other)),
        (90, call(5, task=Reference(BAY, 3))),
        (91, award(5, result=CallResult.REFUSED)),
        until_s=3_600,
    )
    assert (figures.tasks, figures.parked.count, figures.fetched.count) == (2, 1, 1)
    assert (figures.calls, figures.sub_calls, figures.opened_again, figures.refused, figures.bids) == (5, 1, 1, 1, 2)
    assert (figures.calls_per_task, figures.bids_per_task) == (2.5, 1.0)
    assert figures.messages["Heartbeat"] == 1 and figures.messages["TaskReport"] == 3
    assert figures.messages_per_task == 15 / 2, "heartbeats and bus time are no task's"


def test_p55_promised_minus_actual_is_in_bus_time() -> None:
    """The log's clock is 1000 s ahead of bus time, which is about to wrap."""
    bus_s = 2**32 / 1000 - 30
    promises = [(1, 60.0), (2, 20.0), (3, 40.0)]
    said: list[tuple[float, Message]] = [(1000.0, BusTime(BAY, round(bus_s * S)))]
    for number, ends_s in promises:
        task = Reference(BAY, number)
        cost_ms = round((bus_s + 41) * 1000) % 2**32
        said += [(1001.0, call(number, task=task)), (1001.1, Bid(ROBOT, BAY, number, cost_ms, 0))]
        said += [(1001.2, award(number, task=task)), (1000 + ends_s, report(TaskPhase.DONE, task))]
    slack = fold(*sorted(said, key=lambda one: one[0]), until_s=1_100).slack
    assert slack.count == 3
    assert slack.mean_s == pytest.approx((-19 + 21 + 1) / 3, abs=0.002)
    assert slack.worst_s == pytest.approx(-19, abs=0.002)
    assert slack.p95_s == pytest.approx(-17, abs=0.002), "interpolated between -19 and 1"


def test_p55_throughput_and_its_best_hour() -> None:
    said: list[tuple[float, Message]] = []
    for number, end_s in enumerate((100, 3_000, 3_690, 3_705, 9_000), start=1):
        task = Reference(BAY, number)
        said += [(end_s - 50, call(number, task=task)), (end_s - 49, award(number, task=task))]
        said.append((end_s, report(TaskPhase.DONE, task)))
    rate = fold(*sorted(said, key=lambda one: one[0]), until_s=10_000).parked
    assert (rate.count, rate.best_hour) == (5, 3), "the fourth ends an hour and five seconds after the first"
    assert rate.per_h == pytest.approx(1.8)


def test_p55_replans_are_told_by_what_changed_and_why() -> None:
    way = (go(2, 3, 6), work(2, 6), go(2, 6, 8), work(2, 8))
    figures = fold(
        (0, plan(1, Leg(LegAction.STAND, 2, 3, 3, Side.NEAR, 0), award_ms=0, call_number=0)),
        (1, call()),
        (2, award()),
        (2.1, plan(2, *way)),
        (2.2, plan(2, *way)),
        (10, plan(3, *[leg._replace(end_ms=900) for leg in way])),
        (20, Waiting(ROBOT, 2, 7, OTHER, Reason.TOKEN_HELD_BY_OTHER)),
        (25, plan(4, *way[2:])),
        (30, plan(1, go(2, 8, 4), sender=OTHER)),
        (30.01, plan(5, go(2, 6, 9), work(2, 9))),
        (31, report(TaskPhase.DONE)),
        (40, plan(6, go(2, 9, 7))),
        until_s=50,
    )
    assert figures.replans == {
        "times, own time": 1,
        "times, wait: TOKEN_HELD_BY_OTHER": 1,
        "way, another's plan": 1,
        "way, own time": 1,
    }
    assert figures.give_ways == 2, "the answer to another's plan, and the way taken without a task"


def test_p55_measuring_from_a_moment_on_keeps_what_is_open() -> None:
    figures = fold(
        (0, at(3)),
        (5, call()),
        (5.5, Bid(ROBOT, BAY, 1, 70_000, 0)),
        (6, award()),
        (7, Waiting(ROBOT, 2, 5, OTHER, Reason.TOKEN_HELD_BY_OTHER)),
        (60, at(3, 500)),
        (70, report(TaskPhase.DONE)),
        begin_s=50,
        until_s=100,
    )
    assert (figures.seconds_s, figures.calls, figures.bids, figures.tasks) == (50, 0, 0, 1)
    assert figures.slack.count == 1
    assert machine(figures).with_task == pytest.approx(0.4)
    assert machine(figures).longest_wait_s == pytest.approx(10), "only the part that was measured"


def test_what_is_not_of_this_site_changes_nothing() -> None:
    figures = fold(
        (1, at(3, track=77)), (2, at(3, sender=200)), (3, award(9)), (4, report(TaskPhase.DONE)),
        (5, Waiting(200, 1, 1, 0, Reason.NONE)), (6, Bid(ROBOT, 200, 3, 5, 0)), until_s=10,
    )  # fmt: skip
    assert (figures.tasks, figures.calls, figures.robots_travel_mm) == (0, 0, 0)
    assert all(machine.idle == pytest.approx(1) for machine in figures.machines)


def test_p55_times_are_described_as_any_spreadsheet_does() -> None:
    found = Durations.of([4 * S, 1 * S, 2 * S, 3 * S])
    assert (found.count, found.mean_s, found.p50_s, found.max_s) == (4, 2.5, 2.5, 4.0)
    assert found.sigma_s == pytest.approx(1.118034)
    assert found.p95_s == pytest.approx(3.85) and found.p99_s == pytest.approx(3.97)
    assert Durations.of([]) == Durations(0, 0, 0, 0, 0, 0, 0) and str(Durations.of([])) == "nobody"
    assert percentile([7.0], 0.99) == 7.0

"""Who heard nothing for minutes, or was not heard, learns what it missed, and nothing is held against it."""

from dataclasses import replace

import pytest

from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason
from onboard.contract.messages import CarAt, Heartbeat, Message, Progress, SyncDone
from onboard.core.mirror import MISSED_HEARTBEATS
from onboard.holon.holon import Holon
from onboard.ways.mirror import WayMirror, way_mirror
from onboard.ways.missed_cars import ANSWERS
from onboard.ways.standing import STANDS_AFTER_US, WAITS_AFTER_US
from tests.sites import one_floor
from tests.ways.test_car_words import BAY, CAR, HERE, ROBOT, SITE, at, hears
from tests.ways.test_standing import RUN_MS, goes

PERIOD_US = SITE.timing.heartbeat_us
SILENT_US = (MISSED_HEARTBEATS + 1) * PERIOD_US
BEAT = Heartbeat(ROBOT, CONTRACT_VERSION, SITE.digest, 0, 1, KindCode.ROBOT, MachineState.IDLE, 0)
BAYS = replace(BEAT, sender=BAY, kind=KindCode.COMPARTMENT)


def lives(holon: Holon, until_us: int) -> None:
    """Wakes whenever it is due, and hears nothing."""
    while (due_us := holon.next_wake()) is not None and due_us <= until_us:
        holon.wake(due_us)


def planned(holon: Holon) -> int:
    """Under which version it believes the robot's plan."""
    return holon.mirror.itineraries[ROBOT].version


@pytest.mark.parametrize("missed", [100, 127, 128, 200, 254])
def test_however_many_plans_were_missed_the_next_one_counts(missed: int) -> None:
    """Versions have 8 bits: after nine minutes of plans that a cut cable kept from it a new one looked older."""
    bay = hears(BAY, BEAT, goes(4))
    lives(bay, SILENT_US)
    version = (4 + missed) % 256 or 1
    for word in (BEAT, goes(version)):
        bay.receive(word, SILENT_US + 1)
    assert planned(bay) == version
    bay.receive(goes(version - 1 or 255), SILENT_US + 2)
    assert planned(bay) == version, "and from then on the newest"


def test_who_was_heard_all_the_time_is_judged_by_versions() -> None:
    bay = hears(BAY, BEAT, goes(4), goes(200))
    assert planned(bay) == 4


def answers(holon: Holon, times: int, *before_last: Message) -> None:
    """The bay is asked so often and tells all that it has, which is no car."""
    for number in range(times):
        for word in before_last if number == times - 1 else ():
            holon.receive(word, 10)
        holon.receive(SyncDone(BAY, ROBOT, 1, 0), 10)


@pytest.fixture
def robot() -> Holon:
    """It believes in a car that stands at a place of the bay's."""
    return hears(ROBOT, BAYS, at(BAY, HERE, 1))


def places(holon: Holon) -> list[int]:
    return [record.station for record in way_mirror(holon.mirror).cars.values()]


def test_a_car_that_its_keeper_does_not_name_any_more_has_left(robot: Holon) -> None:
    """Of cars that have left a keeper tells the last four: who missed more believed in the others for ever."""
    answers(robot, ANSWERS - 1)
    assert places(robot) == [HERE], "a word may be lost, and an answer heard in part"
    answers(robot, 1)
    assert places(robot) == []
    robot.receive(at(BAY, HERE, 1), 20)
    assert places(robot) == [HERE], "where all of them were lost"


def test_a_car_that_is_named_stands_where_it_does(robot: Holon) -> None:
    for _ in range(3):
        answers(robot, ANSWERS - 1, at(BAY, HERE, 1))
    assert places(robot) == [HERE]


@pytest.mark.parametrize("state", [MachineState.STARTING, MachineState.OBSTACLE, MachineState.STOPPED])
def test_of_a_keeper_that_has_lost_its_journal_all_remember_the_cars(robot: Holon, state: MachineState) -> None:
    """Its rights are made anew from what the others say."""
    robot.receive(replace(BAYS, state=state, boot=2), 5)
    answers(robot, 2 * ANSWERS)
    assert places(robot) == [HERE]


@pytest.mark.parametrize("why", [Reason.NODE_SILENT, Reason.EMERGENCY_STOP, Reason.POSITION_UNKNOWN])
def test_who_could_not_go_has_not_stood(why: Reason) -> None:
    """A robot was back from a bus that was off, said what it waits for, and stood already by what all believed.

    So did all that had a car aboard after an emergency stop of a minute (drawn car parks, operators, 5665).
    """
    mirror = WayMirror(one_floor(), BAY)
    mirror.hear(Progress(ROBOT, 1, 0, 1, 3, 0, 0), 0)
    mirror.on_itinerary(goes(), 0)
    mirror.set_aside(ROBOT, frozenset(), why, SILENT_US)
    back_us = RUN_MS * 1000 + WAITS_AFTER_US
    assert not mirror.stands(ROBOT, back_us)
    mirror.admit(ROBOT, back_us)
    assert not mirror.stands(ROBOT, back_us + STANDS_AFTER_US - 1)
    assert mirror.stands(ROBOT, back_us + STANDS_AFTER_US), "from then on as anybody"


def test_who_is_silent_now_and_then_stands_all_the_same() -> None:
    """What it stood while it was heard adds up."""
    mirror = WayMirror(one_floor(), BAY)
    mirror.hear(Progress(ROBOT, 1, 0, 1, 3, 0, 0), 0)
    mirror.on_itinerary(goes(), 0)
    now_us, heard_us = RUN_MS * 1000, STANDS_AFTER_US - 1
    for _ in range(WAITS_AFTER_US // heard_us + 4):
        if mirror.stands(ROBOT, now_us + heard_us):
            return
        mirror.set_aside(ROBOT, frozenset(), Reason.NODE_SILENT, now_us + heard_us)
        now_us += heard_us + SILENT_US
        mirror.stands(ROBOT, now_us)
        mirror.admit(ROBOT, now_us)
    pytest.fail("it blocks the way for ever")


def test_words_of_cars_are_kept_for_what_is_there_alone(robot: Holon) -> None:
    missed = way_mirror(robot.mirror).missed
    for number in range(1_000):
        missed.named(CarAt(BAY, CAR._replace(number=number), HERE, 1, 2_600))
    answers(robot, 1)
    assert [list(kept) for kept in missed._answers.values()] == [[CAR]]

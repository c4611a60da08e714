"""A task is another's by a newer word of its initiator, or mine once more: its robot tells what is so, and no more."""

from dataclasses import replace

import pytest

from onboard.contract.codes import CallResult, DriveMode, Reason, TaskPhase, TokenKind
from onboard.contract.messages import Award, Bid, CarAt, DriveState, Itinerary, TaskReport, TokenGrant
from onboard.core.authority import station_token
from tests.kinds.test_whose_task import after_a_while
from tests.models.at_work import AtWork, Deed
from tests.models.award import BAY, CAR, CHEAP, DEAR, KEY, PLACE, TASK, WHEELBASE_MM
from tests.models.custody import CALL, HERE, CustodyPart
from tests.models.robots import RobotBody
from tests.models.snapshot import NOW_US, WHILE_US

#: By the version after that under which the robot has it.
ANOTHERS = Award(BAY, 0, DEAR, TASK, 2, CallResult.AWARDED, Reason.NONE)
RIGHT = station_token(PLACE)
PART = CustodyPart(laden=False)


@pytest.fixture
def robot() -> AtWork:
    """It stands beside the car, and waits for the rights to place and car."""
    made = PART.made(CHEAP, PART.journal(CHEAP), PART.body(CHEAP))
    made.starts()
    made.hears(CarAt(BAY, CAR, PLACE.number, 1, WHEELBASE_MM))
    for _ in range(2):
        made, _ = after_a_while(made)
    assert RIGHT in made.fleet.tokens.wanted
    return made


def reports(deeds: list[Deed]) -> list[TaskPhase]:
    return [word.phase for word in deeds if isinstance(word, TaskReport) and word.task == TASK]


def test_the_right_to_the_place_goes_back_though_the_car_never_came(robot: AtWork) -> None:
    """Whose the task was by then waited for the place, and who had the place for the car: both for ever."""
    robot.hears(TokenGrant(BAY, RIGHT.kind, RIGHT.number, 1, CHEAP))
    assert robot.fleet.tokens.holds(RIGHT)
    given = [(word.token, word.holder) for word in robot.hears(ANOTHERS) if isinstance(word, TokenGrant)]
    assert given == [(RIGHT.number, BAY)]


@pytest.mark.parametrize("by_mm", [0, 300], ids=["at its mark", "pushed off it"])
def test_work_that_is_dropped_is_not_told_as_done(robot: AtWork, by_mm: int) -> None:
    """It wrote that it had taken the car, told LOADED, and after a restart believed so."""
    assert isinstance(robot.body, RobotBody)
    at_mm = robot.body.now.position_mm + by_mm
    robot.behaviour.sense(DriveState(CHEAP, 0, at_mm, 0, DriveMode.STANDING, not by_mm), NOW_US)
    deeds = robot.hears(ANOTHERS) + robot.waits(())
    assert reports(deeds) == []
    assert not [deed for deed in deeds if isinstance(deed, tuple) and dict(deed)["record"] == "handled"]


def test_a_car_at_no_place_of_the_site_stands_where_it_stood(robot: AtWork) -> None:
    """Who gave the car back for a word of track 39 looked for that track's keeper, and halted."""
    robot.hears(ANOTHERS)
    for number in (9_999, PLACE.number | 0x7F):
        robot.hears(CarAt(BAY, CAR, number, 1, WHEELBASE_MM))
    deeds = robot.hears(TokenGrant(BAY, KEY.kind, KEY.number, 2, CHEAP))
    back = [(word.token, word.holder) for word in deeds if isinstance(word, TokenGrant)]
    assert back == [(KEY.number, BAY)]
    assert robot.fleet.mirror.cars[CAR].station == PLACE.number


def awarded_anew(robot: AtWork) -> list[Deed]:
    """It is called for again, as nothing was heard of it; the robot bids and wins."""
    call = replace(CALL, call=CALL.call + 1, deadline_ms=(NOW_US + 2 * WHILE_US) // 1000)
    assert [word for word in robot.hears(call) if isinstance(word, Bid)]
    return robot.hears(Award(BAY, call.call, CHEAP, TASK, 2, CallResult.AWARDED, Reason.NONE))


@pytest.fixture
def laden() -> AtWork:
    """It has the car aboard, and asks for the bay."""
    part = CustodyPart()
    made = part.made(CHEAP, part.journal(CHEAP), part.body(CHEAP))
    made.starts()
    for _ in range(2):
        made, _ = after_a_while(made)
    return made


def test_who_has_the_car_aboard_and_wins_it_again_does_not_fetch_it_again(laden: AtWork) -> None:
    """It planned to take the car once more out of where it had been, behind the work in hand."""
    deeds = awarded_anew(laden)
    assert reports(deeds) == [TaskPhase.LOADED]
    assert not [word for word in deeds if isinstance(word, Itinerary)]


def test_who_wins_what_it_has_done_says_so(laden: AtWork) -> None:
    """It went back, and waited for a car that stood where it had left it, until it was late."""
    assert TaskPhase.DONE in reports(laden.hears(TokenGrant(BAY, TokenKind.STATION, HERE.number, 1, CHEAP)))
    says_that_it_is_done(laden)


def test_who_wins_what_it_had_done_before_a_restart_says_so(laden: AtWork) -> None:
    deeds = laden.hears(TokenGrant(BAY, TokenKind.STATION, HERE.number, 1, CHEAP))
    noted = tuple(dict(deed) for deed in deeds if isinstance(deed, tuple))
    assert isinstance(laden.body, RobotBody)
    part = CustodyPart()
    again: AtWork = part.made(CHEAP, (*part.journal(CHEAP), *noted), laden.body.now)
    again.starts()
    for _ in range(2):
        again, _ = after_a_while(again)
    says_that_it_is_done(again)


def says_that_it_is_done(robot: AtWork) -> None:
    deeds = awarded_anew(robot)
    told = [(word.phase, word.station) for word in deeds if isinstance(word, TaskReport)]
    assert told == [(TaskPhase.DONE, HERE.number)]
    assert not [word for word in deeds if isinstance(word, Itinerary)]

"""Compartment and robot come to agree whose a task is, whatever either of them missed, forgot or believed too late."""

import pytest

from onboard.contract.codes import CallResult, Grade, LegAction, Operation, Reason, TaskPhase
from onboard.contract.constants import ANY_STATION, NOBODY
from onboard.contract.messages import (
    Award,
    CallForProposals,
    CarAt,
    Itinerary,
    Leg,
    Reference,
    Stamp,
    SyncRequest,
    TaskReport,
    TokenRefusal,
    TokenRequest,
)
from onboard.core.effects import Send
from onboard.core.records import TokenGivenRecord, TokenGoneRecord
from onboard.systems.car_park import custody
from onboard.systems.car_park.bay_memory import winner_record
from onboard.systems.car_park.bay_task import REMINDERS, BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.program import CarHandling, StationWork
from onboard.systems.car_park.recovery import award_record, handled_record
from tests.models.at_work import AtWork, Deed, Entry
from tests.models.award import BAY, CAR, CHEAP, DEAR, KEY, PLACE, TASK, WHEELBASE_MM, AwardPart
from tests.models.custody import CALL, HERE
from tests.models.snapshot import NOW_US, WHILE_US, copied

PART = AwardPart()
AGAIN = Award(BAY, 0, CHEAP, TASK, 1, CallResult.AWARDED, Reason.NONE)
GIVEN_BACK = TaskReport(CHEAP, TASK, TaskPhase.FORFEITED, 0, Reason.JOURNAL_LOST)


GIVEN_TO_THE_DEAR = [made(KEY.kind, KEY.number, 2, DEAR).entry for made in (TokenGivenRecord, TokenGoneRecord)]


def started(node: int, *more: Entry) -> AtWork:
    """A machine that was started again with more in its journal, and takes part."""
    machine: AtWork = PART.made(node, (*PART.journal(node), *more), PART.body(node))
    machine.starts()
    for _ in range(2):
        machine.waits(())
    return machine


def after_a_while(machine: AtWork) -> tuple[AtWork, list[Deed]]:
    older: AtWork = copied(machine, WHILE_US)
    return older, older.waits(())


def waiting() -> AtWork:
    """The compartment, whose task the cheap robot has won by its journal."""
    return started(BAY, winner_record(CAR, CHEAP, TASK, 1).entry)


def coming(node: int) -> Itinerary:
    """A plan that leads to the bay."""
    leg = Leg(LegAction.WORK, HERE.track, HERE.index, HERE.index, HERE.side, 60_000)
    return Itinerary(node, 1, Grade.FIRM, Stamp(1_000, BAY, 1), (leg,))


def test_a_winner_of_which_nothing_shows_is_told_again_that_it_has_the_task() -> None:
    bay, deeds = after_a_while(waiting())
    assert AGAIN in deeds
    bay.hears(coming(CHEAP))
    bay, deeds = after_a_while(bay)
    assert not [word for word in deeds if isinstance(word, Award)], "its plan leads here"


def called(deeds: list[Deed]) -> list[Reference]:
    return [word.task for word in deeds if isinstance(word, CallForProposals)]


def test_a_winner_that_plans_no_work_and_has_no_right_to_the_car_is_not_waited_for() -> None:
    """It says that it has the task, and stands: the customer waited until that was seen by its place, half a minute."""
    away = Leg(LegAction.TRAVEL, HERE.track, HERE.index, HERE.index + 1, HERE.side, 600_000)
    elsewhere = coming(CHEAP).legs[0]._replace(from_index=HERE.index + 1, to_index=HERE.index + 1)
    for leg, expected in ((away, [TASK]), (elsewhere, [])):
        bay = waiting()
        bay.hears(Itinerary(CHEAP, 1, Grade.FIRM, Stamp(1_000, BAY, 1), (leg,)))
        bay, deeds = after_a_while(bay)
        assert called(deeds) == []
        assert called(after_a_while(bay)[1]) == expected


def came_back(bay: AtWork, *, is_loaded: bool) -> BayPhase | None:
    behaviour = bay.behaviour
    assert isinstance(behaviour, Compartment)
    return behaviour.calls.bay_came_back(NOW_US, is_loaded=is_loaded)[0]


def test_a_bay_that_a_robot_had_and_did_nothing_in_waits_for_whoever_has_the_task_now() -> None:
    """A robot gave the task back before the right reached it: the car was taken for parked, and stayed."""
    assert came_back(elsewhere(), is_loaded=True) is BayPhase.CLOSING
    assert came_back(waiting(), is_loaded=False) is BayPhase.AWAITING, "its car stands in its place"
    fetched = waiting()
    assert isinstance(fetched.behaviour, Compartment)
    custody.state(fetched.behaviour.fleet, CAR, fetched.behaviour.station.number, WHEELBASE_MM)
    assert came_back(fetched, is_loaded=False) is BayPhase.CLOSING, "it was fetched, and may be out already"
    assert came_back(elsewhere(), is_loaded=False) is BayPhase.AWAITING
    brings = started(BAY, winner_record(CAR, DEAR, TASK, 1).entry, *GIVEN_TO_THE_DEAR)
    assert came_back(brings, is_loaded=False) is None, "whoever has it gives it, or asks again"
    bay = started(BAY, winner_record(CAR, NOBODY, TASK, 1).entry, *GIVEN_TO_THE_DEAR)
    assert came_back(bay, is_loaded=False) is BayPhase.AWAITING
    bay.hears(CarAt(DEAR, CAR, PLACE.number, 2, WHEELBASE_MM))
    assert called(after_a_while(bay)[1]) == [TASK], "nobody has it: it is called for"


@pytest.mark.parametrize(
    "word",
    [SyncRequest(CHEAP, BAY, 0), TaskReport(CHEAP, Reference(BAY, 9), TaskPhase.DONE, PLACE.number, Reason.NONE)],
    ids=["it has come back", "it is through with a task"],
)
def test_what_nobody_could_do_is_called_for_as_soon_as_a_robot_may(word: SyncRequest | TaskReport) -> None:
    bay = waiting()
    bay.hears(GIVEN_BACK)
    deeds: list[Deed] = []
    while not any(isinstance(word, Award) and word.result is CallResult.REFUSED for word in deeds):
        bay, deeds = after_a_while(bay)
    assert called(after_a_while(bay)[1]) == [], "that waits for half a minute"
    bay.hears(word)
    assert called(after_a_while(bay)[1]) == [TASK]


def test_a_car_is_not_called_for_while_another_stands_in_the_bay_that_nobody_parks() -> None:
    """Its robot had waited before the bay, and left it at a place: it was brought again, and back, for an hour."""
    bay = waiting()
    assert isinstance(bay.behaviour, Compartment)
    calls = bay.behaviour.calls
    calls.ahead, calls.job = calls.job, BayTask(Reference(BAY, 99), Operation.PARK, Reference(BAY, 99), WHEELBASE_MM)
    left_it = TaskReport(CHEAP, TASK, TaskPhase.DONE, PLACE.number, Reason.NONE)
    said = calls.on_report(left_it, NOW_US, is_starting=False) + calls.review(NOW_US)
    assert called([one.message for one in said if isinstance(one, Send)]) == []
    calls.job.winner = DEAR
    anew = called([one.message for one in calls.review(NOW_US) if isinstance(one, Send)])
    assert len(anew) == 1 and calls.ahead is not None and calls.ahead.task == anew[0] != TASK


def test_what_a_robot_does_not_know_it_gives_back_and_it_is_called_for_anew() -> None:
    assert started(CHEAP).hears(AGAIN) == [GIVEN_BACK]
    deeds = waiting().hears(GIVEN_BACK)
    assert [word.task for word in deeds if isinstance(word, CallForProposals)] == [TASK]


def test_a_robot_that_has_the_task_says_so() -> None:
    robot = started(CHEAP, award_record(CALL, PLACE, HERE, 1).entry)
    said = [word.phase for word in robot.hears(AGAIN) if isinstance(word, TaskReport)]
    assert said == [TaskPhase.AWARDED]


def test_a_robot_that_is_done_says_where_it_left_the_car() -> None:
    """Without the station a compartment took it for left somewhere on the way, and called for it in its own bay."""
    works = (
        StationWork(CarHandling.TAKE, PLACE, CAR, WHEELBASE_MM, CALL),
        StationWork(CarHandling.LEAVE, HERE, CAR, WHEELBASE_MM, CALL),
    )
    robot = started(CHEAP, award_record(CALL, PLACE, HERE, 1).entry, *(handled_record(one).entry for one in works))
    said = [word for word in robot.hears(AGAIN) if isinstance(word, TaskReport)]
    assert said == [TaskReport(CHEAP, TASK, TaskPhase.DONE, HERE.number, Reason.NONE)]


def elsewhere() -> AtWork:
    """The compartment has given the car to the dear robot, and by its journal the cheap one has won the task."""
    return started(BAY, winner_record(CAR, CHEAP, TASK, 1).entry, *GIVEN_TO_THE_DEAR)


def test_a_winner_whom_the_cars_custodian_does_not_know_is_not_waited_for_after_a_restart() -> None:
    bay = elsewhere()
    bay.hears(CarAt(DEAR, CAR, PLACE.number, 2, WHEELBASE_MM))
    refusal = TokenRefusal(DEAR, *KEY, 2, CHEAP, Reason.TOKEN_NOT_GRANTABLE_YET)
    deeds = [deed for _ in range(REMINDERS) for deed in bay.hears(refusal)]
    assert [word.task for word in deeds if isinstance(word, CallForProposals)] == [TASK]


def test_whoever_brings_the_car_has_its_task_whomever_the_compartment_believed() -> None:
    bay = elsewhere()
    bay.hears(CarAt(DEAR, CAR, ANY_STATION, 2, WHEELBASE_MM))
    bay.hears(coming(DEAR))
    told = [word.winner for word in bay.hears(TokenRequest(CHEAP, *KEY, 1, 1, 0)) if isinstance(word, Award)]
    assert told == [DEAR]

"""What is said again, after minutes in which a compartment was not heard, of tasks that are done moves no car."""

from onboard.contract.codes import (
    CallResult,
    Criterion,
    DoorPosition,
    Grade,
    KindCode,
    LegAction,
    LightColour,
    Operation,
    Reason,
    TaskPhase,
    TokenKind,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    BayState,
    CallForProposals,
    CarAt,
    DoorState,
    Itinerary,
    Leg,
    Reference,
    Stamp,
    TaskReport,
    TokenGrant,
    TokenRequest,
)
from onboard.core.effects import Effect, Send
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.ways.mirror import way_mirror
from onboard.ways.tokens import car_token
from tests.kinds.board import taking_part
from tests.kinds.test_changed_places import BAY, CAR, FAST, FIRST, OTHER, SECOND, SLOW, WHEELBASE_MM, Bay
from tests.sites import one_floor

#: Of the site's second compartment.
CALLER = 2
THEIRS, PARKED, FETCHED = Reference(CALLER, 1), Reference(CALLER, 1), Reference(CALLER, 2)


def handed_over() -> Bay:
    """A car was fetched; its driver is in the bay with it."""
    bay = Bay()
    calls = bay.behaviour.calls
    calls.ahead = None
    calls.job = BayTask(FIRST, Operation.RETRIEVE, CAR, WHEELBASE_MM, winner=SLOW, was_granted=True)
    bay.holon.tokens.create(car_token(*CAR))
    way_mirror(bay.holon.mirror).on_car(CarAt(BAY, CAR, bay.behaviour.station.number, 3, WHEELBASE_MM))
    bay.behaviour.phase = BayPhase.HANDOVER
    bay.holon.sense(BayState(BAY, 1_500, 4_300, 1_500, WHEELBASE_MM, True, True, 0), bay.now_us)
    bay.holon.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), bay.now_us)
    return bay


def test_a_bay_comes_to_rest_while_a_driver_gets_into_his_car_whatever_its_robot_says() -> None:
    """The task was to be called again, which waited for the driver to leave: the compartment woke for ever."""
    bay = handed_over()
    bay.holon.receive(TaskReport(SLOW, FIRST, TaskPhase.FORFEITED, 0, Reason.JOURNAL_LOST), bay.now_us)
    wakes, end_us = 0, bay.now_us + 60_000_000
    while (due_us := bay.holon.next_wake()) is not None and due_us <= end_us:
        bay.holon.wake(due_us)
        wakes += 1
        assert wakes < 1_000, "it never comes to rest"


def test_a_car_that_was_fetched_is_called_for_no_more_when_its_robot_falls_silent() -> None:
    """The robot that an old award named was lost, and what was won by another since was taken from that too."""
    bay = handed_over()
    steward = bay.behaviour.stewardship
    steward.winners[CAR], steward.tasks[CAR] = FAST, (PARKED, 1)
    said: list[Effect] = []
    for due_us in range(bay.now_us, 900_000_000, 1_000_000):
        said += bay.holon.wake(due_us)
    words = [one.message for one in said if isinstance(one, Send) and isinstance(one.message, Award | TaskReport)]
    assert not [one for one in words if one.task == FIRST], "it stands in the bay"


def call(number: int, task: Reference, operation: Operation) -> CallForProposals:
    kinds = KindCode.ROBOT, Criterion.FINISH_TIME
    return CallForProposals(
        CALLER, number, task, operation, *kinds, 1, 0, 2_000, 257, ANY_STATION, THEIRS, WHEELBASE_MM
    )


def won(number: int, task: Reference, winner: int) -> Award:
    return Award(CALLER, number, winner, task, 1, CallResult.AWARDED, Reason.NONE)


def given(sender: int, version: int, holder: int) -> TokenGrant:
    return TokenGrant(sender, TokenKind.CAR, car_token(*THEIRS).number, version, holder)


def test_an_award_of_what_is_done_takes_nothing_from_who_won_since() -> None:
    """Whoever missed ``DONE`` says its award again; the robot that came to fetch the car was refused it then."""
    site = one_floor(robots=2, extra='[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,7)"\n')
    keeper, now_us, place = taking_part(site, BAY), 1_000, site.places[0].number
    done = TaskReport(SLOW, PARKED, TaskPhase.DONE, place, Reason.NONE)
    for word in (
        *(call(1, PARKED, Operation.PARK), won(1, PARKED, SLOW), given(CALLER, 2, SLOW)),
        *(CarAt(SLOW, THEIRS, place, 2, WHEELBASE_MM), given(SLOW, 3, BAY), done),
        *(call(2, FETCHED, Operation.RETRIEVE), won(2, FETCHED, FAST), won(1, PARKED, SLOW)),
    ):
        keeper.receive(word, now_us)
        now_us += 10_000
    for robot, is_granted in ((SLOW, False), (FAST, True)):
        asks = TokenRequest(robot, TokenKind.CAR, car_token(*THEIRS).number, 3, 1, 0)
        said = [one.message for one in keeper.receive(asks, now_us) if isinstance(one, Send)]
        assert (given(BAY, 4, robot) in said) is is_granted


def test_who_carries_a_parked_car_here_for_another_has_not_won_to_park_it() -> None:
    """A bay that did not hear its robot for minutes waited for that, and let the other in with the next car instead."""
    bay = Bay()
    calls = bay.behaviour.calls
    calls.job = BayTask(THEIRS, Operation.PARK, THEIRS, WHEELBASE_MM, winner=SLOW, was_granted=True)
    calls.ahead = BayTask(SECOND, Operation.RETRIEVE, OTHER, WHEELBASE_MM, winner=FAST)
    bay.behaviour.phase = BayPhase.OPENING
    here = bay.behaviour.station
    leg = Leg(LegAction.WORK, here.track, here.index, here.index, here.side, 60_000)
    bay.holon.receive(Itinerary(FAST, 1, Grade.FIRM, Stamp(0, BAY, 0), (leg,)), bay.now_us)
    for word in (given(CALLER, 2, FAST), CarAt(FAST, THEIRS, ANY_STATION, 2, WHEELBASE_MM)):
        bay.holon.receive(word, bay.now_us)
    bay.holon.wake(bay.now_us + 1_000_000)
    assert calls.job.winner == SLOW

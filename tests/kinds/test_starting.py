"""A robot that starts: place and shuttle come from sensors and journal, and nobody else touches its program."""

import pytest

from onboard.contract.codes import CallResult, Grade, LegAction, MachineState, Reason, ShuttleMode, TaskPhase
from onboard.contract.messages import Award, Itinerary, Reference, Stamp, TaskReport
from onboard.core.effects import Send
from onboard.core.site import Segment
from onboard.systems.car_park.program import (
    CarHandling,
    CarStep,
    HandlingPhase,
    Program,
    StationWork,
    to_itinerary,
)
from onboard.systems.car_park.recovery import handled_record
from tests.kinds.board import (
    AWARDED,
    BOOT,
    CALL,
    MOVED_US,
    OTHER,
    PLACE,
    ROBOT,
    SITE,
    STEWARD,
    TAKEN,
    TASK,
    Board,
    Entry,
)


def through(index: int) -> Itinerary:
    """The other's plan leads through a position, and stamps it before all others."""
    steps = [
        CarStep(LegAction.TRAVEL, 1, 11, 1, 0, 15_000_000),
        CarStep(LegAction.STAND, 1, 1, 1, 15_000_000, 16_000_000),
    ]
    assert 1 <= index <= 11
    return to_itinerary(OTHER, 1, Grade.FIRM, Stamp(0, OTHER, 0), steps)


def test_no_heard_plan_changes_the_program_of_a_robot_that_starts() -> None:
    board = Board(*AWARDED, TAKEN)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME, load_kg=1_400)
    before = board.plans[-1]
    board.hears(through(6))
    assert board.plans[-1] is before, "what it says of itself stays: it stands where its sensors see it"
    assert [(leg.action, leg.to_index) for leg in before.legs] == [(LegAction.STAND, 6)]
    assert board.drives == []


def test_an_award_of_before_is_given_back_and_changes_nothing() -> None:
    board = Board(*AWARDED, TAKEN)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME, load_kg=1_400)
    plans = len(board.plans)
    board.hears(Award(STEWARD, 9, ROBOT, Reference(STEWARD, 2), 1, CallResult.AWARDED, Reason.NONE))
    assert len(board.plans) == plans


def test_a_shuttle_that_is_out_without_a_handling_holds_the_robot_for_a_person() -> None:
    board = Board(BOOT)
    board.stands(6)
    board.shuttle(ShuttleMode.REACHED)
    board.lives(MOVED_US)
    assert board.state is MachineState.STOPPED
    assert board.drives == []
    board.shuttle(ShuttleMode.HOME)
    board.lives(2 * MOVED_US)
    assert board.state in (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING), "put right by a person"


def test_with_the_shuttle_out_at_another_place_than_the_journals_nothing_moves() -> None:
    step: Entry = {
        "record": "step",
        "phase": HandlingPhase.REACH.value,
        "handling": "leave",
        "station": PLACE.number,
        "car": 1,
    }
    board = Board(*AWARDED, TAKEN, step)
    board.stands(6)
    board.shuttle(ShuttleMode.REACHED, load_kg=1_400)
    board.lives(MOVED_US)
    assert (board.state, board.drives) == (MachineState.STOPPED, [])


@pytest.mark.parametrize(("entries", "load_kg"), [((*AWARDED, TAKEN), 0), (AWARDED, 1_400)])
def test_a_car_aboard_that_the_journal_does_not_know_or_misses_holds_it(
    entries: tuple[Entry, ...], load_kg: int
) -> None:
    board = Board(*entries)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME, load_kg)
    board.lives(MOVED_US)
    assert board.state is MachineState.STOPPED


def test_nothing_goes_on_before_the_shuttle_was_seen() -> None:
    board = Board(BOOT)
    board.stands(6)
    board.lives(MOVED_US)
    assert (board.state, board.drives) == (MachineState.STARTING, [])
    board.shuttle(ShuttleMode.HOME)
    board.lives(2 * MOVED_US)
    assert board.state is MachineState.IDLE


def test_a_first_life_too_takes_part_only_with_its_shuttle_seen_at_home() -> None:
    board = Board()
    board.stands(6)
    states = [board.holon.behaviour.state]
    for mode in (ShuttleMode.REACHED, ShuttleMode.HOME, ShuttleMode.MOVING):
        board.shuttle(mode)
        states.append(board.holon.behaviour.state)
    stopped = MachineState.STOPPED
    assert states == [MachineState.STARTING, stopped, MachineState.IDLE, stopped], "moved by hand it is an obstacle"


def test_pushed_away_while_it_listens_it_says_where_it_is_then() -> None:
    board = Board(BOOT)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME)
    board.stands(7)
    assert [leg.to_index for leg in board.plans[-1].legs] == [7]


def test_pushed_away_while_it_listens_it_says_once_that_its_last_task_is_done() -> None:
    """The checker found it told again in the same life (drawn lines, 885; car parks 4292 and 4297)."""
    board = Board(*AWARDED, TAKEN, handled_record(StationWork(CarHandling.LEAVE, PLACE, TASK, 2_700, CALL)).entry)
    board.stands(9)
    board.shuttle(ShuttleMode.HOME)
    board.stands(7)
    assert [leg.to_index for leg in board.plans[-1].legs] == [7]
    told = [one.message for one in board.said if isinstance(one, Send) and isinstance(one.message, TaskReport)]
    assert [(word.task, word.phase) for word in told] == [(TASK, TaskPhase.DONE)]


def test_a_program_without_a_place_refuses_to_be_changed() -> None:
    program = Program(SITE)
    step = CarStep(LegAction.TRAVEL, 1, 1, 5, 0, 1)
    for change in (
        lambda: program.replace([step], program.stamp),
        lambda: program.shift(1),
        lambda: program.turning(0),
    ):
        with pytest.raises(ValueError, match="no position"):
            change()
    program.begin(Segment(1, 1), [step], program.stamp)
    assert program.standing == Segment(1, 1), "not where a way ends that is not driven yet"
    program.over()
    assert program.standing == Segment(1, 5)

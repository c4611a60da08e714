"""A robot that has stopped itself says why and that it needs a person, as often as its sign of life."""

from onboard.contract.codes import CallResult, MachineState, Reason, ShuttleMode
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Halted, Heartbeat, Message, TaskReport
from onboard.core.effects import Send
from onboard.operate.park import Park
from onboard.operate.words import state_words
from tests.kinds.board import AWARDED, BOOT, CALL, MOVED_US, ROBOT, SITE, STEWARD, TASK, Board

BEAT_US = SITE.timing.heartbeat_us


def said(board: Board, *kinds: type[Message]) -> list[Message]:
    """What it has said of these kinds, but for its words on others that are silent."""
    words = [one.message for one in board.said if isinstance(one, Send) and isinstance(one.message, kinds)]
    return [one for one in words if not isinstance(one, Halted) or one.machine == ROBOT]


def word(reason: Reason) -> Halted:
    return Halted(ROBOT, ROBOT, reason, NOBODY, True, 2)


def test_a_shuttle_that_fails_is_told_with_each_heartbeat() -> None:
    board = Board(BOOT)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME)
    board.lives(MOVED_US)
    assert said(board, Halted) == []
    board.shuttle(ShuttleMode.FAULT)
    board.lives(2 * MOVED_US)
    words = said(board, Heartbeat, Halted)
    after = words[words.index(word(Reason.ACTUATOR_FAULT)) - 1 :]
    assert len(after) // 2 == MOVED_US // BEAT_US
    assert {one.state for one in after[::2] if isinstance(one, Heartbeat)} == {MachineState.STOPPED}
    assert set(after[1::2]) == {word(Reason.ACTUATOR_FAULT)}


def test_a_robot_that_is_held_at_its_start_says_that_its_sensors_contradict_it_until_they_do_not() -> None:
    board = Board(*AWARDED)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME, load_kg=1_400)
    board.lives(MOVED_US)
    assert said(board, Heartbeat, Halted)[-1] == word(Reason.SENSOR_FAULT)
    board.shuttle(ShuttleMode.HOME)
    board.lives(2 * MOVED_US)
    assert isinstance(said(board, Heartbeat, Halted)[-1], Heartbeat), "put right by a person: it says so no more"


def test_status_says_that_it_needs_a_person_and_what_to_do() -> None:
    board = Board(BOOT)
    board.stands(6)
    board.shuttle(ShuttleMode.FAULT)
    board.lives(MOVED_US)
    park = Park(SITE)
    for message in said(board, Heartbeat, Halted):
        park.feed(message, MOVED_US)
    told = state_words(park, ROBOT, MOVED_US)
    assert told.startswith("stands: actuator fault; needs a person: "), told
    assert "start its controller again" in told


def test_it_still_gives_back_what_is_awarded_to_it() -> None:
    """Who has stopped itself hears and answers as ever, unlike one that is held."""
    board = Board(BOOT)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME)
    board.lives(MOVED_US)
    board.hears(CALL)
    board.shuttle(ShuttleMode.FAULT)
    board.lives(2 * MOVED_US)
    board.hears(Award(STEWARD, CALL.call, ROBOT, TASK, 1, CallResult.AWARDED, Reason.NONE))
    assert [one for one in said(board, TaskReport) if isinstance(one, TaskReport) and one.task == TASK]

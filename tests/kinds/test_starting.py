"""A robot that starts: place and shuttle come from sensors and journal, and nobody else touches its program."""

import pytest

from onboard.core.codes import (
    CallResult,
    Criterion,
    DriveMode,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Operation,
    Reason,
    ShuttleMode,
    Side,
)
from onboard.core.effects import Actuate, Effect, Send
from onboard.core.holon import Holon
from onboard.core.messages import (
    Award,
    BusTime,
    CallForProposals,
    DriveOrder,
    DriveState,
    Heartbeat,
    Itinerary,
    Reference,
    ShuttleState,
    Stamp,
)
from onboard.core.site import Segment, Station
from onboard.kinds.car_park.handling import Phase
from onboard.kinds.car_park.program import Handling, Program, Step, Work, to_itinerary
from onboard.kinds.car_park.recovery import award_record, handled_record
from onboard.kinds.registry import factory_for
from tests.sites import one_floor

SITE = one_floor(2)
STEWARD, ROBOT, OTHER = 1, 11, 12
TASK = Reference(STEWARD, 1)
BAY, PLACE = Station(1, 4, Side.NEAR), Station(1, 9, Side.FAR)
CALL = CallForProposals(
    STEWARD, 7, TASK, Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, 1_000, BAY.number, 0, TASK, 2_700
)
AWARDED = {"record": "boot"}, award_record(CALL, BAY, PLACE, 1).entry
TAKEN = handled_record(Work(Handling.TAKE, BAY, TASK, 2_700, CALL)).entry
MOVED_US = 20_000_000


class Board:
    """One robot that was started again, with what its devices and the others say."""

    def __init__(self, *entries: dict[str, str | int]) -> None:
        factory = factory_for(SITE, KindCode.ROBOT)
        self.holon = Holon(SITE, SITE.machines[ROBOT], factory, boot=2, entries=entries)
        self.said: list[Effect] = list(self.holon.start(0))
        self.said += self.holon.receive(BusTime(STEWARD, 0), 0)
        self.holon.tokens.trust()
        self.now_us = 0

    def stands(self, index: int, mode: DriveMode = DriveMode.STANDING) -> None:
        position_mm = (index - 1) * SITE.tracks[1].pitch_mm
        self.said += self.holon.sense(DriveState(ROBOT, 0, position_mm, 0, mode, at_mark=True), self.now_us)

    def shuttle(self, mode: ShuttleMode, load_kg: int = 0) -> None:
        self.said += self.holon.sense(ShuttleState(ROBOT, 0, mode, 0, Side.FAR, load_kg, 2_500), self.now_us)

    def hears(self, *messages: Itinerary | Award) -> None:
        for message in messages:
            self.said += self.holon.receive(message, self.now_us)

    def lives(self, until_us: int) -> None:
        """Wakes whenever it is due."""
        while True:
            due_us = self.holon.next_wake()
            if due_us is None or due_us > until_us:
                break
            assert due_us > self.now_us or self.now_us == 0, "it wakes for ever at one moment"
            self.now_us = max(due_us, self.now_us + 1)
            self.said += self.holon.wake(self.now_us)
        self.now_us = until_us

    @property
    def state(self) -> MachineState:
        return [one.message.state for one in self.said if isinstance(one, Send) and isinstance(one.message, Heartbeat)][
            -1
        ]

    @property
    def plans(self) -> list[Itinerary]:
        return [one.message for one in self.said if isinstance(one, Send) and isinstance(one.message, Itinerary)]

    @property
    def drives(self) -> list[DriveOrder]:
        return [one.message for one in self.said if isinstance(one, Actuate) and isinstance(one.message, DriveOrder)]


def through(index: int) -> Itinerary:
    """The other's plan leads through a position, and stamps it before all others."""
    steps = [Step(LegAction.TRAVEL, 1, 11, 1, 0, 15_000_000), Step(LegAction.STAND, 1, 1, 1, 15_000_000, 16_000_000)]
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
    board = Board({"record": "boot"})
    board.stands(6)
    board.shuttle(ShuttleMode.REACHED)
    board.lives(MOVED_US)
    assert board.state is MachineState.STOPPED
    assert board.drives == []
    board.shuttle(ShuttleMode.HOME)
    board.lives(2 * MOVED_US)
    assert board.state in (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING), "put right by a person"


def test_with_the_shuttle_out_at_another_place_than_the_journals_nothing_moves() -> None:
    step = {"record": "step", "phase": Phase.REACH.value, "handling": "leave", "station": PLACE.number, "car": 1}
    board = Board(*AWARDED, TAKEN, step)
    board.stands(6)
    board.shuttle(ShuttleMode.REACHED, load_kg=1_400)
    board.lives(MOVED_US)
    assert (board.state, board.drives) == (MachineState.STOPPED, [])


@pytest.mark.parametrize(("entries", "load_kg"), [((*AWARDED, TAKEN), 0), (AWARDED, 1_400)])
def test_a_car_aboard_that_the_journal_does_not_know_or_misses_holds_it(
    entries: tuple[dict[str, str | int], ...], load_kg: int
) -> None:
    board = Board(*entries)
    board.stands(6)
    board.shuttle(ShuttleMode.HOME, load_kg)
    board.lives(MOVED_US)
    assert board.state is MachineState.STOPPED


def test_nothing_goes_on_before_the_shuttle_was_seen() -> None:
    board = Board({"record": "boot"})
    board.stands(6)
    board.lives(MOVED_US)
    assert (board.state, board.drives) == (MachineState.STARTING, [])
    board.shuttle(ShuttleMode.HOME)
    board.lives(2 * MOVED_US)
    assert board.state is MachineState.IDLE


def test_pushed_away_while_it_listens_it_says_where_it_is_then() -> None:
    board = Board({"record": "boot"})
    board.stands(6)
    board.shuttle(ShuttleMode.HOME)
    board.stands(7)
    assert [leg.to_index for leg in board.plans[-1].legs] == [7]


def test_a_program_without_a_place_refuses_to_be_changed() -> None:
    program = Program(SITE)
    step = Step(LegAction.TRAVEL, 1, 1, 5, 0, 1)
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

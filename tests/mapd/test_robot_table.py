"""A robot's steps: each phase meets whatever may have been heard, and one line of the table follows another."""

from dataclasses import dataclass, field
from itertools import product

import pytest

from onboard.contract.mapd import PathHead, StepRound, StepState, StepTurn
from onboard.contract.mapd_device import CartState
from onboard.contract.messages import BusTime, SyncRequest
from onboard.core.effects import Effect, Record, Send
from onboard.core.motion_authority import acts
from onboard.holon.holon import Holon
from onboard.systems.mapd.asking import ASK_US
from onboard.systems.mapd.calls import award_of, call_of
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.memory import path_record, step_record
from onboard.systems.mapd.paths import Path
from onboard.systems.mapd.records import PathRecord
from onboard.systems.mapd.robot import UnitRobot
from onboard.systems.mapd.steps import LAST, STEP_TABLE, GridStepPhase, StepDeed, StepFinding
from onboard.systems.mapd.tasks import TransportTask
from onboard.systems.registry import factory_for
from tests.conformance.alone import Alone
from tests.mapd.sites import made

SITE = made(2, [(0, "1,2", "3,5")])
DESK, ME, OTHER = 1, 11, 12
TASK = 0
NOW_US, LATER_US = 10_000_000, 60_000_000


@dataclass(frozen=True)
class Words:
    """What was heard in step 0 before this robot looks."""

    #: Whether the round was told, and whether it is for bids.
    round: str
    #: Where the other robot is: here, still behind, or here with a path that nobody knows.
    other: str
    #: Who plans when the round is closed; open where it is not.
    turns: str
    has_call: bool
    has_won: bool


WORDS = [
    Words(*words)
    for words in product(
        ("none", "bids", "go"),
        ("here", "behind", "pathless"),
        ("open", "nobody", "me", "me after one who has not planned", "me after one who has"),
        (True, False),
        (True, False),
    )
]


def robot(words: Words) -> UnitRobot:
    machine = SITE.machines[ME]
    one = Holon(SITE, machine, factory_for(SITE, machine.kind)).behaviour
    assert isinstance(one, UnitRobot)
    one.fleet.motion.why_still = acts
    one.sense(CartState(ME, 0, SITE.homes[ME], False, NO_TASK), NOW_US)
    if words.has_call:
        pickup, delivery = (SITE.floor.names.index(name) for name in ("1,2", "3,5"))
        one.hear(call_of(DESK, TransportTask(TASK, 0, pickup, delivery), NOW_US), NOW_US)
    if words.other != "behind":
        one.hear(StepState(OTHER, 0, SITE.homes[OTHER], NO_TASK, False, False), NOW_US)
    if words.other != "pathless":
        version = 1 if words.turns == "me after one who has" else 0
        one.hear(PathHead(OTHER, 0, SITE.homes[OTHER], 0, version, False), NOW_US)
    if words.round != "none":
        one.hear(StepRound(DESK, 0, 1, 0, words.round == "bids"), NOW_US)
    planners = {"nobody": [0], "me": [ME]}.get(words.turns, [OTHER, ME]) if words.turns != "open" else []
    for index, planner in enumerate(planners):
        one.hear(StepTurn(DESK, 0, index, len(planners), planner, words.has_won and planner == ME), NOW_US)
    if ME in planners and words.has_won:
        one.hear(award_of(DESK, 0, ME, TASK), NOW_US)
    return one


@dataclass
class Expected:
    """The table walked by what the words mean: where a robot stands with them, and what it says."""

    words: Words
    phase: GridStepPhase = GridStepPhase.GATHER
    step: int = 0
    is_told: bool = False
    has_begun: bool = False
    has_planned: bool = False
    has_arrived: bool = False
    met: set[tuple[GridStepPhase, StepFinding]] = field(default_factory=set)

    def meant(self, *, late: bool) -> StepFinding:
        """What the words come to now, told once more."""
        words, is_first = self.words, self.step == 0
        is_closed = is_first and words.turns != "open"
        match self.phase:
            case GridStepPhase.GATHER:
                return self.gathering(is_closed=is_closed, late=late)
            case GridStepPhase.BID:
                return (
                    StepFinding.CLOSED if is_closed else StepFinding.OPEN if self.has_begun else StepFinding.NOT_BEGUN
                )
            case GridStepPhase.TURNS:
                if words.turns == "nobody" or self.has_planned:
                    return StepFinding.ALL_PLANNED
                knows_won = words.has_call or not words.has_won
                is_next = words.turns != "me after one who has not planned" and knows_won
                return StepFinding.MY_TURN if is_next else StepFinding.MISSING
        return StepFinding.ARRIVED if self.has_arrived else StepFinding.ON_PATH

    def gathering(self, *, is_closed: bool, late: bool) -> StepFinding:
        words = self.words
        round_told = words.round if self.step == 0 else "none"
        if not self.is_told:
            return StepFinding.UNTOLD
        if round_told == "none" and not late:
            return StepFinding.EARLY
        if round_told == "none" or words.other != "here":
            return StepFinding.MISSING
        if round_told == "go":
            return StepFinding.ROUND_TO_GO
        # The round counts one open task.
        return StepFinding.ROUND_TO_BID if words.has_call or is_closed else StepFinding.OTHER_TASKS

    def walk(self, *, late: bool) -> list[object]:
        """Lines until nothing is left to do; what is said and written on the way."""
        said: list[object] = []
        deed = StepDeed.PASS
        while deed not in LAST:
            finding = self.meant(late=late)
            self.met.add((self.phase, finding))
            self.phase, deed = STEP_TABLE[self.phase, finding]
            match deed:
                case StepDeed.TELL:
                    self.is_told = True
                    said.append(("here", self.step))
                case StepDeed.BEGIN_BIDS:
                    self.has_begun = True
                case StepDeed.PLAN:
                    self.has_planned = True
                    said.append("plans")
                case StepDeed.DRIVE:
                    # Without a turn it stays at home, and is in its next cell at once.
                    if self.has_planned:
                        return said
                    self.has_arrived = True
                case StepDeed.NEXT_STEP:
                    self.step, self.is_told, self.has_arrived = self.step + 1, False, False
                case StepDeed.ASK | StepDeed.ASK_TASKS | StepDeed.LOOK if late:
                    said.append("asks")
        return said


def told(effects: list[Effect]) -> list[object]:
    found: list[object] = []
    for one in effects:
        match one:
            case Send(StepState() as state):
                found.append(("here", state.step))
            case Send(SyncRequest()) if "asks" not in found:
                found.append("asks")
            case Record(PathRecord()):
                found.append("plans")
    return found


@pytest.mark.parametrize("heard", ["none", "bids", "go"])
def test_every_phase_meets_whatever_was_heard(heard: str) -> None:
    for words in [one for one in WORDS if one.round == heard]:
        one, expected = robot(words), Expected(words)
        for now_us in (NOW_US, LATER_US):
            said = expected.walk(late=now_us == LATER_US)
            assert told(one.advance(now_us)) == said, (words, now_us)
            assert (one.phase, one.step) == (expected.phase, expected.step), (words, now_us)


def test_the_desk_is_asked_only_some_time_after_the_last_has_come() -> None:
    """Who had waited for a straggler asked at once: the desk said all its calls while it had only begun to open."""
    one = robot(Words("none", "behind", "open", has_call=True, has_won=False))
    assert told(one.advance(NOW_US)) == [("here", 0)]
    come_us = NOW_US + SITE.step_us + ASK_US - 100_000
    one.hear(StepState(OTHER, 0, SITE.homes[OTHER], NO_TASK, False, False), come_us)
    assert told(one.advance(come_us + 200_000)) == []
    again = StepState(OTHER, 0, SITE.homes[OTHER], NO_TASK, False, False)
    one.hear(again, come_us + 300_000)
    assert told(one.advance(come_us + ASK_US)) == ["asks"], "what is said again keeps nobody from asking"


def test_a_robot_whose_own_path_gave_way_to_anothers_asks_for_it() -> None:
    one = robot(Words("none", "here", "open", has_call=True, has_won=False))
    one.phase = GridStepPhase.MOVE
    one.knowledge.paths.take(ME)
    assert one.advance(NOW_US) == []
    assert (one.phase, STEP_TABLE[GridStepPhase.MOVE, StepFinding.MISSING][1]) == (GridStepPhase.MOVE, StepDeed.ASK)


def test_a_line_of_the_table_is_for_what_can_be() -> None:
    met = {(GridStepPhase.MOVE, StepFinding.MISSING)}
    for words in WORDS:
        expected = Expected(words)
        expected.walk(late=False)
        expected.walk(late=True)
        met |= expected.met
    assert met == set(STEP_TABLE)


def test_who_had_set_out_tells_after_a_restart_where_it_had_come_to() -> None:
    """Another that had forgotten it waited for that word in its cell, and it for the cell: all power had been cut."""
    home, beside = SITE.homes[ME], SITE.floor.ways[SITE.homes[ME]][0]
    journal = [path_record(Path(0, (home, home, beside)), 1, TASK).entry, step_record(2).entry]
    again = Alone(SITE, ME, [{"record": "boot", "boot": 1}, *journal], boot=2)
    again.hears(BusTime(DESK, 0))
    again.senses(CartState(ME, 0, home, False, NO_TASK))
    again.passes(5)
    again.hears(SyncRequest(OTHER, ME, 0))
    again.passes(1)
    assert StepState(ME, 1, home, TASK, False, False) in again.sent(StepState)

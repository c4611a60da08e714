"""A terminal's desk alone: what it answers at its counter, tells all, journals, and says again, and until when."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import TypeVar

import pytest

from onboard.contract.codes import Grade, KindCode, ManualMode, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    CarAt,
    Itinerary,
    ManualOrder,
    ManualState,
    Message,
    Reference,
    Stamp,
    TaskReport,
    TokenGrant,
    TokenRefusal,
    TokenRequest,
)
from onboard.contract.terminal import (
    Action,
    BoxOrder,
    LaneState,
    PlanHead,
    PlanStep,
    PlanTask,
    StepReport,
    StepResult,
    TaskTerms,
    Verb,
)
from onboard.contract.terminal_device import LaneSensor, ManualKey, MissionAnswer, MissionKey
from onboard.core.journal_records import Entry
from onboard.systems.terminal.site import Terminal
from onboard.ways.tokens import car_token
from tests.conformance.alone import Alone
from tests.terminal.seeds import short

M = TypeVar("M", bound=Message)
SECOND = 1_000_000
DESK, QUAY, R1, R2, PERSON = 1, 2, 11, 12, 254


@cache
def site() -> Terminal:
    return short("")


def place(name: str) -> int:
    return site().by_name[name].number


def box(name: str) -> int:
    return next(number for number, one in enumerate(site().boxes, 1) if one.name == name)


class Counter(Alone):
    """A desk among vehicles that live."""

    def __init__(self, entries: Iterable[Entry] = (), boot: int = 1, says: Iterable[Message] = ()) -> None:
        """``says`` are words of others while it starts."""
        super().__init__(site(), DESK, entries, boot)
        self.passes(2)
        self.hears(*says)
        self.passes(18)

    def answers(self) -> list[tuple[int, bool]]:
        """Said at the counter: mission, and whether it is taken."""
        return [(one.mission, one.is_taken) for one in self.told(MissionAnswer)]


def load(mission: int = 7, count: int = 2, source: str = "A4", to: str = "S1", *, urgent: bool = False) -> MissionKey:
    """So many of the first type of boxes."""
    return MissionKey(DESK, mission, Verb.LOAD, 0, count, place(source), place(to), 0, urgent)


def tranship(mission: int, *names: str, to: str = "S4") -> list[MissionKey]:
    words = [MissionKey(DESK, mission, Verb.TRANSHIP, box(one), 0, 0, place(to), 0, False) for one in names]
    return [*words, MissionKey(DESK, mission, Verb.END, 0, len(names), 0, place(to), 0, False)]


def test_a_mission_is_answered_and_its_boxes_are_called_for_one_by_one() -> None:
    desk = Counter()
    desk.senses(load(count=2))
    assert desk.answers() == [(7, True)]
    calls = desk.sent(CallForProposals)
    assert {one.kind for one in calls} == {KindCode.VEHICLE} and {one.to_station for one in calls} == {place("S1")}
    assert len({one.task for one in calls}) == len({one.car for one in calls}) == 2
    assert {one.task for one in desk.sent(TaskTerms)} == {one.task for one in calls}


def test_a_mission_that_is_said_again_is_answered_again_and_done_once() -> None:
    desk = Counter()
    desk.senses(load(count=1), load(count=1))
    desk.passes(10)
    assert desk.answers() == [(7, True)] * 2
    assert len({one.task for one in desk.sent(CallForProposals)}) == 1


def test_a_mission_that_was_taken_is_not_taken_again_after_a_restart() -> None:
    first = Counter()
    first.senses(*tranship(9, "B4"))
    assert first.answers() == [(9, True)]
    again = Counter(first.journal, boot=2)
    assert [one.car.number for one in again.sent(CallForProposals)][:1] == [box("B4")], "it is called for by itself"
    calls = len(again.sent(CallForProposals))
    again.senses(*tranship(9, "B4"))
    assert again.answers() == [(9, True)] * 2, "each word of it is answered"
    assert len(again.sent(CallForProposals)) == calls


def test_a_mission_of_several_boxes_is_nothing_until_it_has_come_whole() -> None:
    desk, (one, two, end) = Counter(), tranship(9, "B3", "B4")
    desk.senses(one, end)
    assert desk.answers() == [] and desk.sent(CallForProposals) == []
    desk.senses(two, end)
    assert desk.answers() == [(9, True)]


@pytest.mark.parametrize(
    "key",
    [
        load(to="A1"),
        load(source="S1", count=0),
        load(source="L3"),
        MissionKey(DESK, 7, Verb.LOAD, 99, 1, place("A4"), place("S1"), 0, False),
    ],
    ids=["an area is no station", "no boxes", "a lane has no boxes", "no such type"],
)
def test_what_cannot_be_carried_out_is_refused_at_the_counter(key: MissionKey) -> None:
    desk = Counter()
    before = len(desk.journal)
    desk.senses(key)
    assert desk.answers() == [(7, False)]
    assert desk.sent(CallForProposals) == [] and len(desk.journal) == before


def test_an_urgent_mission_goes_before_one_that_was_called_for() -> None:
    desk = Counter()
    desk.senses(load(7, 4))
    first = desk.sent(CallForProposals)
    desk.senses(load(8, 1, to="S4", urgent=True))
    news = desk.sent(CallForProposals)[len(first) :]
    assert [one.to_station for one in news][:1] == [place("S4")]


def test_who_may_not_end_tasks_is_counted_and_changes_nothing() -> None:
    desk = Counter()
    desk.senses(*tranship(9, "B4"))
    (task,) = {one.task for one in desk.sent(CallForProposals)}
    desk.hears(TaskReport(QUAY, task, TaskPhase.DONE, place("S4"), Reason.NONE))
    assert desk.holon.drops[Reason.NOT_OF_KIND] == 1
    desk.hears(TaskReport(R1, task, TaskPhase.DONE, place("S4"), Reason.NONE))
    desk.passes(60)
    assert not any("is done" in line for line in desk.reported()), "R1 has not won it"


# --- who has a task -----------------------------------------------------------------------------------------------


def won(desk: Counter, vehicle: int = R1) -> CallForProposals:
    """The newest call, which this vehicle has won by the only bid."""
    call = desk.sent(CallForProposals)[-1]
    desk.hears(Bid(vehicle, DESK, call.call, call.deadline_ms + 60_000, 0))
    desk.passes(3)
    assert {one.winner for one in desk.sent(Award) if one.task == call.task} == {vehicle}
    return call


def test_a_task_is_over_once_its_own_winner_says_so() -> None:
    desk = Counter()
    desk.senses(*tranship(9, "B4"))
    call = won(desk)
    desk.hears(TaskReport(R2, call.task, TaskPhase.DONE, place("S4"), Reason.NONE))
    assert not any("is done" in line for line in desk.reported()), "R2 has not won it"
    desk.hears(TaskReport(R1, call.task, TaskPhase.DONE, place("S4"), Reason.NONE))
    assert any(f"task {call.task.number} is done" in line for line in desk.reported())
    again = Counter(desk.journal, boot=2)
    assert again.sent(CallForProposals) == [], "and after a restart too"


def test_what_its_winner_gives_back_is_called_for_again() -> None:
    desk = Counter()
    desk.senses(*tranship(9, "B4"))
    call = won(desk)
    desk.hears(TaskReport(R1, call.task, TaskPhase.FORFEITED, place("S2"), Reason.IMPOSSIBLE))
    desk.passes(10)
    news = [one for one in desk.sent(CallForProposals) if one.call > call.call]
    assert {one.car.number for one in news} == {box("B4")}


@pytest.mark.parametrize("has_won", [True, False])
def test_who_won_a_task_as_the_desks_power_failed_has_it_and_else_it_is_called_for_again(has_won: bool) -> None:
    """Of boxes wanted by their type one more was fetched, and another mission got one too few."""
    first = Counter()
    first.senses(load(count=1))
    (task,) = {one.task for one in first.sent(CallForProposals)}
    claim = TaskReport(R1, task, TaskPhase.AWARDED, place("S1"), Reason.NONE)
    again = Counter(first.journal, boot=2, says=[claim] if has_won else [])
    assert (again.sent(CallForProposals) == []) is has_won
    again.hears(TaskReport(R1, task, TaskPhase.DONE, place("S1"), Reason.NONE))
    assert any(f"task {task.number} is done" in line for line in again.reported()) is has_won


def test_a_box_for_which_another_desk_calls_is_not_called_for() -> None:
    desk, other = Counter(), Counter()
    other.senses(*tranship(9, "B4"))
    theirs = other.sent(CallForProposals)[-1]
    desk.hears(replace(theirs, sender=QUAY, task=Reference(QUAY, 1)))
    desk.senses(*tranship(9, "B4"))
    assert desk.answers() == [(9, True)] and desk.sent(CallForProposals) == []


def test_a_box_whose_right_is_with_a_silent_vehicle_is_called_for_by_nobody() -> None:
    """It was aboard, and its vehicle cut off while the desk's power failed: another was sent, and waited for a box.

    It stood docked at the stack, and all others stood before that.
    """
    first = Counter()
    first.senses(*tranship(9, "B4"))
    call, number = won(first), car_token(*site().box(box("B4"))).number
    key = TokenKind.CAR, number
    takes = PlanStep(R1, 1, 0, Action.PICK_UP, place("S2"), 60_000, 0, 0)
    leaves = PlanStep(R1, 1, 1, Action.PUT_DOWN, place("S4"), 90_000, 0, 0)
    plan = PlanHead(R1, 1, 2, 1, 0), takes, leaves, PlanTask(R1, 1, 0, 0, 1, box("B4"), call.task)
    first.hears(Itinerary(R1, 1, Grade.FIRM, Stamp(0, DESK, 0), ()), *plan, TokenRequest(R1, *key, 0, 1, 0))
    assert TokenGrant(DESK, *key, 1, R1) in first.sent(TokenGrant), "it fetches the box"
    again = Counter(first.journal, boot=2)
    again.passes(600, silent=R1)
    assert again.sent(CallForProposals) == [] and again.sent(Award) == []
    again.hears(CarAt(R1, site().box(box("B4")), place("S4"), 1, 0), TokenGrant(R1, *key, 2, DESK))
    again.passes(20)
    assert again.sent(CallForProposals) == [], "it has come"


@pytest.mark.parametrize("has_come", [False, True])
def test_a_box_that_is_carried_for_another_desk_is_not_mine_though_its_winner_was_not_heard_to_give_it_up(
    has_come: bool,
) -> None:
    """Of boxes wanted by their type one was counted twice, by both desks, and one mission got one too few."""
    desk = Counter()
    desk.senses(load(count=1))
    call, theirs = won(desk), Reference(QUAY, 1)
    takes = PlanStep(R1, 1, 0, Action.PICK_UP, call.from_station, 60_000, 0, 0)
    leaves = PlanStep(R1, 1, 1, Action.PUT_DOWN, place("S1"), 90_000, 0, 0)
    plan = PlanHead(R1, 1, 2, 1, 0), takes, leaves, PlanTask(R1, 1, 0, 0, 1, call.car.number, theirs)
    taken = TaskReport(R1, call.task, TaskPhase.AWARDED, place("S1"), Reason.NONE)
    desk.hears(taken, Itinerary(R1, 1, Grade.FIRM, Stamp(0, QUAY, 0), ()), *plan)
    if has_come:
        desk.passes(6)
        done = StepReport(R1, 1, 1, StepResult.DONE, place("S1"), 30_000)
        desk.hears(CarAt(R1, call.car, place("S1"), 1, 0), done)
    desk.passes(20)
    assert not any("is done" in line for line in desk.reported())
    last = [one for one in desk.sent(Award) if one.task == call.task][-1]
    assert last.reason is Reason.CANCELLED, "its winner is not to blame"
    anew = next(one.car.number for one in desk.sent(CallForProposals) if one.task != call.task)
    assert anew != call.car.number and site().boxes[anew - 1].type == site().boxes[call.car.number - 1].type


@pytest.mark.parametrize("is_from_outside", [False, True])
def test_a_box_that_somebody_else_brought_where_it_was_to_come_is_waited_for_no_more(is_from_outside: bool) -> None:
    """Its vehicle had given it up while another, which was not heard, had it aboard."""
    desk = Counter()
    desk.senses(*tranship(9, "B4")) if not is_from_outside else desk.hears(wanted(9, "B4", "S4"))
    call = won(desk)
    desk.hears(TaskReport(R1, call.task, TaskPhase.AWARDED, place("S4"), Reason.NONE))
    desk.hears(CarAt(R2, call.car, ANY_STATION, 1, 0))
    desk.hears(TaskReport(R1, call.task, TaskPhase.FORFEITED, place("S2"), Reason.NONE))
    desk.hears(CarAt(R2, call.car, place("S4"), 1, 0))
    desk.passes(10)
    assert "box B4 stands where it was to come" in desk.reported()
    assert [one.call for one in desk.sent(CallForProposals)] == [call.call], "nobody is called for it"
    assert told(desk, 9)[-1:] == ([(TaskPhase.DONE, Reason.NONE)] if is_from_outside else [])
    again = Counter(desk.journal, boot=2)
    assert again.sent(CallForProposals) == []


# --- lanes -----------------------------------------------------------------------------------------------------


def test_a_blocked_lane_is_told_to_all_again_and_again_and_that_it_is_free_too() -> None:
    desk, lane = Counter(), place("L11")
    desk.senses(LaneSensor(DESK, lane, False))
    assert desk.sent(LaneState) == [], "nobody thought that it was blocked"
    desk.senses(LaneSensor(DESK, lane, True), LaneSensor(DESK, lane, True))
    (told,) = desk.sent(LaneState)
    assert (told.lane, told.blocked) == (lane, True)
    desk.passes(30)
    repeated = desk.sent(LaneState)
    assert len(repeated) > 4 and set(repeated) == {told}, "a vehicle that was off hears it, and since when"
    desk.senses(LaneSensor(DESK, lane, False))
    assert not desk.sent(LaneState)[-1].blocked


@pytest.mark.parametrize("name", ["S1", "A4", "C1"])
def test_only_lanes_are_blocked(name: str) -> None:
    desk = Counter()
    desk.senses(LaneSensor(DESK, place(name), True))
    assert desk.sent(LaneState) == []


# --- a person's hand ---------------------------------------------------------------------------------------------


def test_a_key_for_a_vehicle_is_said_until_the_vehicle_itself_has_heard_it() -> None:
    desk = Counter()
    desk.senses(ManualKey(DESK, 3, R1, ManualMode.HELD))
    begin_us = desk.now_us
    desk.passes(5)
    orders = desk.sent(ManualOrder)
    assert len(orders) >= 5 and set(orders) == {ManualOrder(DESK, R1, 3, ManualMode.HELD)}
    desk.hears(ManualState(R2, 3, ManualMode.HELD, at_rest=True), ManualState(R1, 2, ManualMode.HELD, at_rest=True))
    desk.passes(2)
    assert len(desk.sent(ManualOrder)) > len(orders), "another vehicle's word, and one for an earlier order, is none"
    desk.hears(ManualState(R1, 3, ManualMode.HELD, at_rest=False))
    done = len(desk.sent(ManualOrder))
    desk.passes(5)
    assert len(desk.sent(ManualOrder)) == done
    assert begin_us < desk.now_us


def test_a_key_for_what_is_no_vehicle_is_nothing() -> None:
    desk = Counter()
    desk.senses(ManualKey(DESK, 3, QUAY, ManualMode.HELD))
    assert desk.sent(ManualOrder) == []


@pytest.mark.parametrize("is_heard", [True, False])
def test_for_vehicles_that_are_held_nothing_is_called(is_heard: bool) -> None:
    """Nor for ever for who was let go while the desk was deaf (drawn 892)."""
    desk = Counter()
    desk.hears(*(ManualState(node, 1, ManualMode.HELD, at_rest=True) for node in site().vehicles))
    desk.senses(load())
    desk.passes(20, held=site().vehicles)
    assert desk.answers() == [(7, True)] and desk.sent(CallForProposals) == []
    if is_heard:
        desk.hears(ManualState(R1, 2, ManualMode.AUTOMATIC, at_rest=False))
    desk.passes(20, held=set(site().vehicles) - {R1})
    assert len({one.task for one in desk.sent(CallForProposals)}) == 1, "one vehicle is free, so one box"


# --- orders from outside ----------------------------------------------------------------------------------------


def wanted(number: int, name: str, to: str, desk: int = DESK) -> BoxOrder:
    return BoxOrder(PERSON, desk, number, box(name), place(to), 0, False)


def told(desk: Counter, number: int) -> list[tuple[TaskPhase, Reason]]:
    return [(one.phase, one.reason) for one in desk.sent(TaskReport) if one.task == Reference(PERSON, number)]


def test_a_box_that_is_ordered_from_outside_is_answered_each_time_and_called_for_once() -> None:
    desk = Counter()
    desk.hears(wanted(1, "B4", "S4"), wanted(1, "B4", "S4"))
    assert told(desk, 1) == [(TaskPhase.OPEN, Reason.NONE)] * 2
    assert {one.task for one in desk.sent(CallForProposals)} == {Reference(PERSON, 1)}
    desk.hears(wanted(2, "B4", "S1"))
    assert told(desk, 2) == [(TaskPhase.REFUSED, Reason.IMPOSSIBLE)], "somebody has ordered that box already"
    desk.hears(wanted(3, "B3", "A1"))
    assert told(desk, 3) == [(TaskPhase.REFUSED, Reason.IMPOSSIBLE)], "an area is no station"
    desk.hears(wanted(4, "B4", "S2"))
    assert told(desk, 4) == [(TaskPhase.DONE, Reason.NONE)], "there it stands"
    desk.hears(wanted(5, "B3", "S4", desk=QUAY))
    assert told(desk, 5) == [], "that is another desk's"


def test_what_was_ordered_from_outside_outlives_the_desk() -> None:
    first = Counter()
    first.hears(wanted(1, "B4", "S4"))
    again = Counter(first.journal, boot=2)
    again.hears(wanted(1, "B4", "S4"))
    assert told(again, 1) == [(TaskPhase.OPEN, Reason.NONE)]
    assert {one.task for one in again.sent(CallForProposals)} == {Reference(PERSON, 1)}


def test_a_box_under_another_waits_and_a_person_is_told_once_what_for() -> None:
    """Row M08: nobody clears a stack by itself. B3 stands under B4."""
    desk = Counter()
    desk.senses(*tranship(9, "B3"))
    desk.passes(60)
    assert desk.answers() == [(9, True)] and desk.sent(CallForProposals) == []
    told = [line for line in desk.reported() if "is above it" in line]
    assert told == ["box B3 waits: B4 is above it, and nobody ordered that away"]


# --- rights ------------------------------------------------------------------------------------------------------


def test_a_slot_is_not_given_to_a_vehicle_that_has_told_no_plan_through_it() -> None:
    desk = Counter()
    slot = site().entities[place("C1")].number << 8 | 1
    desk.hears(TokenRequest(R1, TokenKind.SEGMENT, slot, 0, 0, 0))
    assert [one.reason for one in desk.sent(TokenRefusal)] == [Reason.MIRROR_BEHIND]


@pytest.mark.parametrize(("name", "why"), [("B3", Reason.TOKEN_NOT_GRANTABLE_YET), ("B4", None)])
def test_a_box_under_another_is_nobodys_yet(name: str, why: Reason | None) -> None:
    """Row M17: whoever had the right to it would keep the stack to itself while the other stands on it."""
    desk = Counter()
    steps = (Action.DOCK, Action.PICK_UP, Action.UNDOCK)
    desk.hears(Itinerary(R1, 1, Grade.FIRM, Stamp(1, DESK, 1), ()))
    desk.hears(PlanHead(R1, 1, len(steps), 1, 20_000))
    desk.hears(PlanTask(R1, 1, 0, 1, 2, box(name), Reference(DESK, 1)))
    for number, action in enumerate(steps):
        desk.hears(PlanStep(R1, 1, number, action, place("S2"), 2_000 * (number + 1), 0, 0))
    origin, number = site().box(box(name))
    desk.hears(TokenRequest(R1, TokenKind.CAR, origin << 16 | number, 0, 0, 0))
    assert [one.reason for one in desk.sent(TokenRefusal)] == ([] if why is None else [why])
    assert len(desk.sent(TokenGrant)) == (why is None)


def test_who_claims_a_task_that_the_desk_does_not_know_hears_that_nobody_has_it() -> None:
    """It was silent while its desk took it back, and called for that box under another name."""
    desk = Counter()
    desk.hears(TaskReport(R1, Reference(DESK, 99), TaskPhase.AWARDED, place("S4"), Reason.NONE))
    assert [(one.task, one.winner) for one in desk.sent(Award)] == [(Reference(DESK, 99), 0)]
    desk.hears(TaskReport(R1, Reference(QUAY, 99), TaskPhase.AWARDED, place("S4"), Reason.NONE))
    assert len(desk.sent(Award)) == 1, "it is not this desk's"

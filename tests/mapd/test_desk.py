"""The desk of pick-up and delivery alone: what it answers, calls for, awards, and tells again after a restart."""

from collections.abc import Iterable
from functools import cache

import pytest

from onboard.contract.codes import CallResult, KindCode, OrderResult, Reason
from onboard.contract.mapd import PathHead, StepRound, StepState, StepTurn, TurnRequest
from onboard.contract.mapd_device import TransportAnswer, TransportKey
from onboard.contract.messages import Award, Bid, CallForProposals, SyncRequest
from onboard.core.effects import Send
from onboard.core.journal_records import Entry
from onboard.systems.mapd.calls import CALL_AGAIN_US, CALLS_A_ROUND
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.knowledge import PLAIN
from onboard.systems.mapd.site import Mapd
from tests.conformance.alone import Alone
from tests.mapd.sites import made

DESK, R1, R2 = 1, 11, 12
#: The robots' homes, and two free cells beside shelves: row times ten and column.
HOMES = {R1: 0, R2: 9}
NEAR, FAR = 12, 35
STEP_US = 20_000


@cache
def site() -> Mapd:
    return made(2, [])


class Counter(Alone):
    """A desk; robots tell where they are when the test lets them."""

    def __init__(self, entries: Iterable[Entry] = (), boot: int = 1) -> None:
        super().__init__(site(), DESK, entries, boot)
        self.passes(5, STEP_US)

    def stand(self, step: int = 0, *robots: int) -> None:
        """Robots come to a step where they are, with no way to go."""
        for robot in robots or HOMES:
            self.hears(StepState(robot, step, HOMES[robot], NO_TASK, False, False))
            self.hears(PathHead(robot, step, HOMES[robot], 0, step + 1, False))

    def opened(self) -> StepRound:
        """The round that is open, as it was told last."""
        return self.sent(StepRound)[-1]

    def bid(self, robot: int, task: int, cost: int, *, off: int = 0) -> None:
        """A bid in the open round, or in one that is ``off`` by so much."""
        mark = (self.opened().step + 61 * self.opened().attempt + off) & 0xFF
        self.hears(Bid(robot, DESK, task + 1, cost, mark))

    def awarded(self) -> dict[int, int]:
        """Task by robot, of all awards."""
        return {one.winner: one.task.number for one in self.sent(Award) if one.result is CallResult.AWARDED}

    def answers(self) -> list[tuple[int, OrderResult]]:
        return [(one.task, one.transport_result) for one in self.told(TransportAnswer)]


def key(task: int = 3, pickup: int = NEAR, delivery: int = FAR, release: int = 0) -> TransportKey:
    return TransportKey(DESK, task, pickup, delivery, release)


@pytest.fixture
def desk() -> Counter:
    return Counter()


@pytest.fixture
def open_round(desk: Counter) -> Counter:
    """Both robots stand in step 0, and bids for task 3 are asked for."""
    desk.senses(key())
    desk.stand()
    while not desk.sent(StepRound):
        desk.passes(STEP_US / 1e6, STEP_US)
    assert desk.opened().bidding and [one.task.number for one in desk.sent(CallForProposals)][:1] == [3]
    return desk


def least(robot: int) -> int:
    """The lowest cost that a robot at home can have for task 3: its way there and the way of the load."""
    floor = site().floor
    empty, loaded = floor.steps_to(NEAR)[HOMES[robot]], floor.steps_to(FAR)[NEAR]
    return min(PLAIN.wait, PLAIN.empty) * empty + PLAIN.loaded * loaded


# --- the counter -------------------------------------------------------------------------------------------------


def test_an_order_is_answered_each_time_and_written_down_once(desk: Counter) -> None:
    desk.senses(key(), key(), key())
    assert desk.answers() == [(3, OrderResult.RECEIVED)] * 3
    assert [one["task"] for one in desk.journal if one["record"] == "transport"] == [3]


@pytest.mark.parametrize(("pickup", "delivery"), [(NEAR, 50), (4_000, FAR)])
def test_cells_that_are_not_on_the_map_are_refused(desk: Counter, pickup: int, delivery: int) -> None:
    desk.senses(key(pickup=pickup, delivery=delivery))
    assert desk.answers() == [(3, OrderResult.REFUSED)]
    assert not [one for one in desk.journal if one["record"] == "transport"]


def test_what_was_served_is_answered_so_also_after_a_restart(open_round: Counter) -> None:
    desk = open_round
    desk.hears(StepState(R1, 1, NEAR, 3, True, False))
    desk.hears(StepState(R1, 2, FAR, 3, False, True))
    assert desk.answers()[-1] == (3, OrderResult.DONE)
    desk.senses(key())
    assert desk.answers()[-1] == (3, OrderResult.DONE)
    again = Counter(desk.journal, boot=2)
    again.senses(key())
    assert again.answers() == [(3, OrderResult.DONE)]


# --- rounds ------------------------------------------------------------------------------------------------------


def test_no_round_is_opened_before_all_robots_have_come_to_the_step(desk: Counter) -> None:
    desk.senses(key())
    desk.stand(0, R1)
    desk.passes(3, STEP_US)
    assert desk.sent(StepRound) == []
    assert {one.whom for one in desk.sent(SyncRequest)} >= {R2}, "who is missed is asked"
    desk.stand(0, R2)
    desk.passes(2, STEP_US)
    assert desk.opened().step == 0


def test_the_round_is_opened_as_soon_as_the_last_robot_has_come(desk: Counter) -> None:
    """It waited until it would have asked again, by when those who had come asked the desk for the round."""
    desk.senses(key())
    desk.stand(0, R1)
    asked = len(desk.sent(SyncRequest))
    while len(desk.sent(SyncRequest)) == asked:
        desk.passes(STEP_US / 1e6, STEP_US)
    desk.passes(2 * STEP_US / 1e6, STEP_US)
    desk.stand(0, R2)
    desk.passes(STEP_US / 1e6, STEP_US)
    assert desk.sent(StepRound)


def test_a_task_is_called_for_from_its_step_on_and_not_before(desk: Counter) -> None:
    desk.senses(key(3), key(4, release=2))
    desk.stand()
    desk.passes(2, STEP_US)
    assert {one.task.number for one in desk.sent(CallForProposals)} == {3}
    for step in (1, 2):
        desk.stand(step)
        desk.passes(3, STEP_US)
    calls = desk.sent(CallForProposals)
    assert {one.task.number for one in calls} == {3, 4}
    assert {(one.kind, one.from_station, one.to_station) for one in calls} == {(KindCode.VEHICLE, NEAR, FAR)}


def test_the_lower_bid_wins_and_both_the_award_and_the_turn_say_so(open_round: Counter) -> None:
    desk = open_round
    desk.bid(R2, 3, least(R2) + 50)
    desk.bid(R1, 3, least(R1) + 10)
    desk.passes(3, STEP_US)
    assert desk.awarded() == {R1: 3}
    turns = [one for one in desk.sent(StepTurn) if one.step == 0]
    assert {(one.robot, one.won) for one in turns} == {(R1, True)}


def test_a_bid_that_no_robot_could_have_is_counted_and_wins_nothing(open_round: Counter) -> None:
    desk = open_round
    desk.bid(R2, 3, 1)
    desk.bid(R1, 3, least(R1) + 10)
    desk.passes(3, STEP_US)
    assert desk.holon.drops[Reason.FALSE_STATEMENT] == 1
    assert desk.awarded() == {R1: 3}


@pytest.mark.parametrize("off", [-1, 1, 61])
def test_a_bid_of_another_round_does_not_count(open_round: Counter, off: int) -> None:
    desk = open_round
    desk.bid(R1, 3, least(R1) + 10, off=off)
    desk.passes(3, STEP_US)
    assert desk.awarded() == {}


@pytest.mark.parametrize(("cell", "order"), [(FAR, [R2, R1]), (HOMES[R2], [R1, R2])])
def test_who_makes_room_plans_before_who_has_won_and_who_only_waits_elsewhere_after(
    cell: int, order: list[int]
) -> None:
    desk = Counter()
    desk.senses(key())
    desk.stand(0, R1)
    desk.hears(StepState(R2, 0, cell, NO_TASK, False, False))
    desk.hears(PathHead(R2, 0, cell, 0, 1, False))
    while not desk.sent(StepRound):
        desk.passes(STEP_US / 1e6, STEP_US)
    desk.hears(TurnRequest(R2, desk.opened().step, desk.opened().attempt))
    desk.bid(R1, 3, least(R1) + 10)
    desk.passes(3, STEP_US)
    turns = sorted({(one.index, one.robot, one.won) for one in desk.sent(StepTurn) if one.step == 0})
    assert turns == [(at, robot, robot == R1) for at, robot in enumerate(order)]


def test_a_robot_that_carries_makes_room_too_and_keeps_what_it_carries(open_round: Counter) -> None:
    desk = open_round
    desk.senses(key(4, pickup=35, delivery=12))
    desk.bid(R1, 3, least(R1) + 10)
    desk.passes(3, STEP_US)
    desk.hears(PathHead(R1, 1, NEAR, 0, 2, False))
    desk.hears(StepState(R1, 1, NEAR, 3, True, False))
    desk.stand(1, R2)
    while desk.opened().step == 0:
        desk.passes(STEP_US / 1e6, STEP_US)
    desk.hears(TurnRequest(R1, desk.opened().step, desk.opened().attempt))
    desk.passes(3, STEP_US)
    assert {(one.robot, one.won) for one in desk.sent(StepTurn) if one.step == 1} == {(R1, False)}


def test_a_round_that_nobody_bids_in_is_closed_with_no_change(open_round: Counter) -> None:
    open_round.passes(3, STEP_US)
    assert open_round.awarded() == {}
    assert {(one.robot, one.won) for one in open_round.sent(StepTurn)} == {(0, False)}


def test_many_tasks_at_once_are_called_for_round_by_round_oldest_first(desk: Counter) -> None:
    desk.senses(*(key(number) for number in range(CALLS_A_ROUND + 30)))
    desk.stand()
    while not desk.sent(StepRound):
        desk.passes(STEP_US / 1e6, STEP_US)
    assert {one.task.number for one in desk.sent(CallForProposals)} == set(range(CALLS_A_ROUND))
    assert desk.opened().open_tasks == CALLS_A_ROUND, "who counts others asks"
    desk.passes(1, STEP_US)
    desk.stand(1)
    while desk.opened().step == 0:
        desk.passes(STEP_US / 1e6, STEP_US)
    assert {one.task.number for one in desk.sent(CallForProposals)} == set(range(CALLS_A_ROUND + 30))


def test_however_many_ask_the_calls_take_a_part_of_the_bus_only(desk: Counter) -> None:
    desk.senses(*(key(number) for number in range(CALLS_A_ROUND)))
    desk.stand()
    while not desk.sent(StepRound):
        desk.passes(STEP_US / 1e6, STEP_US)
    said = []
    for at_us in range(10_000_000, 12_000_000, 200_000):
        effects = desk.holon.behaviour.statements(at_us)
        said.append(sum(isinstance(one, Send) and isinstance(one.message, CallForProposals) for one in effects))
    each = CALL_AGAIN_US * CALLS_A_ROUND // 200_000 + 1
    assert said == [CALLS_A_ROUND if not number % each else 0 for number in range(10)]


# --- power-up ----------------------------------------------------------------------------------------------------


def test_after_a_restart_the_desk_tells_the_same_awards(open_round: Counter) -> None:
    desk = open_round
    desk.bid(R1, 3, least(R1) + 10)
    desk.passes(3, STEP_US)
    again = Counter(desk.journal, boot=2)
    again.hears(SyncRequest(R2, DESK, 1))
    again.passes(2, STEP_US)
    assert again.awarded() == {R1: 3}
    assert {(one.step, one.robot) for one in again.sent(StepTurn)} == {(0, R1)}


def test_a_round_that_was_open_is_opened_again_under_another_mark(open_round: Counter) -> None:
    """Bids of the first one are not taken for bids of the second."""
    desk = open_round
    again = Counter([{"record": "boot", "boot": 1}, *desk.journal], boot=2)
    again.stand()
    again.passes(2, STEP_US)
    assert (again.opened().step, again.opened().attempt) != (desk.opened().step, desk.opened().attempt)
    assert again.opened().step == desk.opened().step == 0

"""The robot is before the car at the right moment and done as early as it can, and its bid is that date (P36, P41)."""

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import Criterion, DoorPosition, DriveMode, Grade, LegAction, Operation, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    DoorState,
    DriveState,
    Itinerary,
    TaskReport,
)
from onboard.core.serial import from_bus_ms
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays


@pytest.fixture(scope="module")
def entry() -> Scene:
    """One car on the small site, parked by one of two robots."""
    scene = play(at_the_key(find_site("small")), stays((0, None)))
    scene.assert_sound()
    return scene


def bus_offset_us(scene: Scene) -> int:
    """Bus time minus loop time, by the last word of its source."""
    at, word = scene.all(BusTime, "fleet")[-1]
    return word.bus_time_us - at


def test_p41_the_bid_is_the_date_at_which_the_task_ends(entry: Scene) -> None:
    _, call = entry.first(CallForProposals, lambda m: m.operation is Operation.PARK)
    assert call.criterion is Criterion.FINISH_TIME
    _, award = entry.first(Award, lambda m: m.task == call.task)
    bids = [m for _, m in entry.all(Bid, "fleet") if (m.initiator, m.call) == (call.sender, call.call)]
    done_us, _ = entry.first(TaskReport, lambda m: m.task == call.task and m.phase is TaskPhase.DONE)
    offset_us = bus_offset_us(entry)
    promised_us = from_bus_ms(bids[-1].cost, done_us) - offset_us
    assert bids[-1].sender == award.winner
    assert 0 <= promised_us - done_us < 2_000_000
    # The plan says the same date: where its last work ends.
    _, plan = entry.first(Itinerary, lambda m: m.sender == award.winner and m.grade is Grade.FIRM and len(m.legs) > 2)
    works = [leg for leg in plan.legs if leg.action is LegAction.WORK]
    assert abs(works[-1].end_ms - bids[-1].cost) <= 1


def test_p36_the_robot_stands_before_the_car_when_it_may_take_it_and_waits_nowhere_after(entry: Scene) -> None:
    _, call = entry.first(CallForProposals, lambda m: m.operation is Operation.PARK)
    _, award = entry.first(Award, lambda m: m.task == call.task)
    started_us, _ = entry.first(TaskReport, lambda m: m.task == call.task and m.phase is TaskPhase.STARTED)
    opens_us, _ = entry.first(DoorState, lambda m: m.output_door is not DoorPosition.LOCKED, after_us=started_us)
    stands_us = max(
        at
        for at, m in entry.all(DriveState)
        if m.sender == award.winner and m.mode is DriveMode.STANDING and at <= started_us
    )
    # The door opens at once for whoever stands there; before that nobody waited longer than for the customer's leaving.
    assert stands_us <= started_us and opens_us - started_us < 1_000_000
    _, plan = entry.first(Itinerary, lambda m: m.sender == award.winner and m.grade is Grade.FIRM and len(m.legs) > 2)
    actions = [leg.action for leg in plan.legs]
    first, last = actions.index(LegAction.WORK), len(actions) - 1 - actions[::-1].index(LegAction.WORK)
    assert LegAction.STAND not in actions[first:last], "as early as possible: nothing but driving between the two works"

"""The robot is before the car at the right moment and done as early as it can, and its bid is that date (P36, P41)."""

from collections.abc import Sequence

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import Criterion, DoorPosition, Grade, LegAction, Operation, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    DoorState,
    Itinerary,
    Progress,
    TaskReport,
)
from onboard.core.serial import from_bus_ms
from onboard.systems.car_park.site import car_park
from tests.cut import Timed, first_of, shown_at
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

SECOND = 1_000_000


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
    bay = car_park(entry.simulation.site).compartments[1]

    def check(heard: Sequence[Timed]) -> None:
        _, call = first_of(heard, CallForProposals, lambda m: m.operation is Operation.PARK)
        award_us, award = first_of(heard, Award, lambda m: m.task == call.task)
        at_bay = (award.winner, bay.track, bay.index, 0)
        stands_us, _ = first_of(
            heard, Progress, lambda m: (m.sender, m.track, m.index, m.speed_mm_s) == at_bay, after_us=award_us
        )
        opens_us, _ = first_of(heard, DoorState, lambda m: m.output_door is not DoorPosition.LOCKED, after_us=award_us)
        # The door opens for whoever stands there, at once: nobody was waited for, and it had not come too soon.
        assert stands_us < opens_us < stands_us + SECOND
        _, plan = first_of(
            heard, Itinerary, lambda m: m.sender == award.winner and m.grade is Grade.FIRM and len(m.legs) > 2
        )
        actions = [leg.action for leg in plan.legs]
        first, last = actions.index(LegAction.WORK), len(actions) - 1 - actions[::-1].index(LegAction.WORK)
        assert LegAction.STAND not in actions[first:last], "as early as possible: nothing but driving between the works"
        loaded_us, _ = first_of(heard, TaskReport, lambda m: (m.task, m.phase) == (call.task, TaskPhase.LOADED))
        done_us, done = first_of(heard, TaskReport, lambda m: (m.task, m.phase) == (call.task, TaskPhase.DONE))
        stops = [
            (m.track, m.index)
            for at, m in heard
            if isinstance(m, Progress) and m.sender == award.winner and loaded_us < at < done_us and not m.speed_mm_s
        ]
        # It stands where a leg of its plan begins or ends, and nowhere between.
        place = plan.legs[last]
        allowed = {(leg.track, end) for leg in plan.legs for end in (leg.from_index, leg.to_index)}
        assert set(stops) <= allowed
        assert done.station == place.track << 8 | place.side << 7 | place.to_index

    said = [(one.time_us, one.message) for one in entry.said]
    shown_at(check, said, CallForProposals, Award, Progress, DoorState, Itinerary, TaskReport)

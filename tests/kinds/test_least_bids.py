"""A bid that its bidder cannot keep, by what it has told, counts for no compartment."""

from dataclasses import replace

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp
from onboard.systems.car_park.least_bids import SLACK_MS, LeastCosts
from onboard.ways.mirror import WayMirror
from tests.sites import one_floor
from tests.trace.checking import MR1, call

#: At p(1,10), six positions from the bay.
HERE = Progress(MR1, 1, 0, 1, 10, 0, 0)
CALL = call(deadline_s=2)
BUSY_MS = 60_000


def at_work(until_ms: int) -> Itinerary:
    """It works where it is until then, and goes back somewhere afterwards."""
    work = Leg(LegAction.WORK, 1, 10, 10, Side.NEAR, until_ms)
    away = Leg(LegAction.TRAVEL, 1, 10, 12, Side.NEAR, until_ms + 10_000)
    return Itinerary(MR1, 1, Grade.FIRM, Stamp(0, 1, 1), (work, away))


def least(costs: LeastCosts, plan: Itinerary | None, seen: Progress | None) -> int:
    """The least bid that counts, bus ms."""
    return next(cost for cost in range(0, 200_000, 10) if costs.is_possible(CALL, cost, plan, seen))


def test_nobody_can_be_done_sooner_than_its_way_from_where_it_is() -> None:
    costs = LeastCosts(WayMirror(one_floor(2), MR1))
    floor_ms, idle_ms = costs.floor(CALL, 1_000_000), least(costs, None, HERE)
    assert least(costs, None, replace(HERE, index=4)) == pytest.approx(floor_ms - SLACK_MS, abs=10)
    assert idle_ms > floor_ms - SLACK_MS
    assert least(costs, at_work(1_900), HERE) == idle_ms, "what is over by the deadline delays nothing"


def test_who_has_work_in_hand_comes_after_it() -> None:
    costs = LeastCosts(WayMirror(one_floor(2), MR1))
    after_ms = least(costs, at_work(BUSY_MS), HERE)
    later_ms = least(costs, at_work(2 * BUSY_MS), HERE)
    assert after_ms > BUSY_MS - SLACK_MS
    assert later_ms - after_ms == BUSY_MS


def test_of_who_has_told_nothing_nobody_knows() -> None:
    costs = LeastCosts(WayMirror(one_floor(2), MR1))
    assert costs.is_possible(CALL, 0, None, None)
    assert costs.is_possible(CALL, 0, None, Progress(MR1, 1, 0, 77, 3, 0, 0)), "a place of no site"

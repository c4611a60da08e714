"""Who is followed at once can still take another way, or another task: plans meet by the rounding of their times."""

import pytest

from onboard.contract.codes import Grade, LegAction
from onboard.contract.messages import Stamp
from onboard.core.site import Segment
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import CarHandling, CarStep, Program, StationWork, to_itinerary
from onboard.ways.mirror import WayMirror
from onboard.ways.reservations import SlotWindow
from tests.sites import one_floor
from tests.trace.checking import MR1, MR2, TASK, call

#: A run over three segments takes 7.8 s.
BEGIN_US, THERE_US, END_US = 10_000_000, 16_000_000, 23_800_000
THERE = Segment(1, 6)


def followed(by_us: int | None) -> CarParkGeneration:
    """It goes by p(1,6) to p(1,3); another comes into p(1,6) so long before it has left that, or nobody does."""
    site = one_floor(2)
    program, mirror = Program(site), WayMirror(site, MR1)
    runs = [
        CarStep(LegAction.TRAVEL, 1, 8, 6, BEGIN_US, THERE_US),
        CarStep(LegAction.TRAVEL, 1, 6, 3, THERE_US, END_US),
    ]
    stamp = Stamp(BEGIN_US // 1000, MR1, 0)
    program.begin(Segment(1, 8), runs, stamp)
    assert mirror.on_itinerary(to_itinerary(MR1, 1, Grade.FIRM, stamp, runs), BEGIN_US)
    if by_us is not None:
        left_us = max(end_us for _, end_us, node in mirror.reservations.on(THERE) if node == MR1)
        mirror.reservations.reserve(MR2, [SlotWindow(THERE, left_us - by_us, left_us + 20_000_000)])
    return CarParkGeneration(site, site.machines[MR1], mirror, program)


@pytest.mark.parametrize(("by_us", "finds"), [(None, True), (555, True), (10_000, True), (20_000, False)])
def test_it_finds_its_way_where_the_other_comes_no_sooner_than_rounding_tells(by_us: int | None, finds: bool) -> None:
    """The search took half a millisecond for a body in the way, and three plans were put off for ever (4693)."""
    robot = followed(by_us)
    place = next(one for one in robot.site.places if one.segment == Segment(1, 3))
    work = StationWork(CarHandling.LEAVE, place, TASK, 2_700, call())
    assert (robot.reroute(THERE, THERE_US, [work], BEGIN_US) is not None) is finds


def test_it_bids_as_if_nobody_followed() -> None:
    alone, _ = followed(None).solve(call(), BEGIN_US)
    assert alone is not None
    assert followed(555).solve(call(), BEGIN_US)[0] == alone
    assert followed(20_000).solve(call(), BEGIN_US)[0] is None

"""A robot that has a car to leave in a bay does not bid for the car that stands there: it would wait for itself."""

from dataclasses import replace

import pytest

from onboard.contract.codes import LegAction, Operation
from onboard.contract.messages import Reference, Stamp
from onboard.core.site import Segment, Station
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import CarHandling, CarStep, Program, StationWork
from onboard.ways.mirror import WayMirror
from tests.sites import one_floor
from tests.trace.checking import MR1, TASK, call

NOW_US = 1_000_000
PARK = call(task=Reference(1, 2))


def robot(ends_at: Station | None) -> CarParkGeneration:
    """It stands at home, and has a car aboard that it leaves at a station, or nothing to do."""
    site = one_floor(2)
    home, steps = site.machines[MR1].home, list[CarStep]()
    if ends_at is not None:
        work = StationWork(CarHandling.LEAVE, ends_at, TASK, 2_700, call())
        here = ends_at.segment
        run = CarStep(LegAction.TRAVEL, 1, home.index, here.index, NOW_US, NOW_US + 20_000_000)
        steps = [run, CarStep(LegAction.WORK, 1, here.index, here.index, NOW_US, NOW_US + 40_000_000, work)]
    program = Program(site)
    program.begin(Segment(1, home.index), steps, Stamp(0, 1, 1))
    return CarParkGeneration(site, site.machines[MR1], WayMirror(site, MR1), program)


@pytest.mark.parametrize(("where", "bids"), [("nowhere", True), ("there", False), ("at a place", True)])
def test_it_bids_but_where_it_would_stand_before_the_car_that_it_is_to_take(where: str, bids: bool) -> None:
    """Its winner was lost, and the robot that was on its way to that bay won: 8 of 14 stayed inside (drawn, 4513)."""
    site = one_floor(2)
    ends = {"nowhere": None, "there": site.compartments[1], "at a place": site.places[0]}
    assert (robot(ends[where]).lower_bound(PARK, NOW_US) is not None) is bids


def test_a_car_that_it_is_about_to_leave_is_fetched_from_there() -> None:
    place = one_floor(2).places[0]
    fetch = replace(PARK, operation=Operation.RETRIEVE, from_station=place.number, to_station=PARK.from_station)
    assert robot(place).lower_bound(fetch, NOW_US) is not None

"""Figure 7 of Pujo, Ounnar, Zanni 2006: two robots, five floors, a lift at each end (rows P36 to P38, P43, P44, P46).

MRalpha comes up in the left lift, drops a car at p(5,12), takes another at p(5,8) and leaves by the right lift.
MRlambda goes from p(1,4) to p(5,12): to p(1,1), up in the left lift, to p(5,1) and on to where it waits, and follows.

The paper's anti-collision distance lies between two bodies and is counted once; a site's clearance lies on either side
of each body. So MRalpha's windows are those of a body as long as a place, and MRlambda plans with the whole distance
on its side. Durations are not in the paper. The fast clock has no acceleration worth a millisecond: one place a second.
"""

from typing import NamedTuple

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.lift_uses import are_compatible, ride_us
from onboard.ways.occupancy import itinerary_windows, lift_uses
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow
from onboard.ways.sipp import Route, RouteLeg, Visit, plan_route
from onboard.ways.site import Axis
from tests.ways.buildings import LEFT, RIGHT, building
from tests.ways.lift_itineraries import Ride, lift_itineraries

PLACES = 16
PITCH_MM, FLOOR_MM = 2_400, 2_500
SECOND = 1_000_000
ALPHA, LAMBDA = 12, 11
START, GOAL = Segment(1, 4), Segment(5, 12)


class Clock(NamedTuple):
    """Axes of carriers and lifts, and how long each works at a place."""

    carrier: Axis
    lift: Axis
    work_us: int


FAST = Clock(Axis(2_400, 2_400_000_000), Axis(2_500, 2_500_000_000), 8 * SECOND)
REAL = Clock(Axis(1_500, 500), Axis(1_083, 500), 15 * SECOND)


def park(clock: Clock, places_between: int, floors: int = 5) -> CarPark:
    """The site as seen by a body that keeps so many places free before and behind it."""
    return building(
        floors,
        PLACES,
        clock.carrier,
        pitch_mm=PITCH_MM,
        floor_mm=FLOOR_MM,
        carrier_length_mm=PITCH_MM,
        clearance_mm=places_between * PITCH_MM,
        lift=clock.lift,
    )


def itinerary(node: int, legs: list[RouteLeg]) -> Itinerary:
    told = tuple(
        Leg(leg.action, leg.track, leg.from_index, leg.to_index, Side.NEAR, leg.end_us // 1000) for leg in legs
    )
    return Itinerary(node, 1, Grade.FIRM, Stamp(0, 1, 1), told)


def alpha_plan(clock: Clock) -> Itinerary:
    """MRalpha: up from floor 1 at once, two works, down by the right lift, rest at p(3,9)."""
    site = park(clock, 0)
    runs = {places: run_duration_us(places * PITCH_MM, clock.carrier) for places in range(PLACES + 1)}
    legs: list[RouteLeg] = []
    for action, track, from_index, to_index, duration_us in (
        (LegAction.RIDE, LEFT, 1, 5, ride_us(site, LEFT, 1, 5)),
        (LegAction.TRAVEL, 5, 0, 12, runs[12]),
        (LegAction.WORK, 5, 12, 12, clock.work_us),
        (LegAction.TRAVEL, 5, 12, 8, runs[4]),
        (LegAction.WORK, 5, 8, 8, clock.work_us),
        (LegAction.TRAVEL, 5, 8, PLACES + 1, runs[PLACES + 1 - 8]),
        (LegAction.RIDE, RIGHT, 5, 3, ride_us(site, RIGHT, 5, 3)),
        (LegAction.TRAVEL, 3, PLACES + 1, 9, runs[PLACES + 1 - 9]),
    ):
        begin_us = legs[-1].end_us if legs else 0
        legs.append(RouteLeg(action, track, from_index, to_index, begin_us, begin_us + duration_us))
    return itinerary(ALPHA, legs)


def reserved(clock: Clock) -> Reservations:
    site, plan = park(clock, 0), alpha_plan(clock)
    reservations = Reservations()
    reservations.reserve(ALPHA, itinerary_windows(site, plan, 0), lift_uses(site, plan, 0))
    return reservations


def follow(clock: Clock, clearance: int, *via: Segment) -> Route:
    """MRlambda's plan with an anti-collision distance of ``clearance`` places, by way of some positions."""
    visits = (*(Visit(position, 0) for position in via), Visit(GOAL, clock.work_us))
    site, floors = park(clock, clearance - 1), {LEFT: 1, RIGHT: 5}
    route = plan_route(site, reserved(clock), LAMBDA, START, 0, visits, frozenset({GOAL}), 4_000, floors)
    assert isinstance(route, Route), route
    return route


def stops(route: Route) -> list[tuple[str, int, int]]:
    """Action, track and last index of each leg that moves."""
    return [
        (leg.action.name, leg.track, leg.to_index)
        for leg in route.legs
        if leg.action in (LegAction.TRAVEL, LegAction.RIDE)
    ]


# --- the scene --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("clearance", "waits_at"), [(4, 4), (3, 5)])
def test_p43_mrlambda_waits_clearance_places_behind_mralpha_and_follows(clearance: int, waits_at: int) -> None:
    route = follow(FAST, clearance)
    assert stops(route) == [
        ("TRAVEL", 1, 1),
        ("TRAVEL", 1, 0),
        ("RIDE", LEFT, 5),
        ("TRAVEL", 5, waits_at),
        ("TRAVEL", 5, 12),
    ]
    waits = [leg for leg in route.legs if leg.action is LegAction.STAND and leg.track == 5]
    assert [leg.from_index for leg in waits] == [waits_at]
    # MRalpha still works at p(5,8) when it comes.
    taken = alpha_plan(FAST).legs[4].end_ms * 1000
    assert waits[0].begin_us < taken < waits[0].end_us


@pytest.mark.parametrize("clock", [FAST, REAL])
def test_p38_waiting_for_mralpha_beats_every_way_around_it(clock: Clock) -> None:
    """Whatever leads to the fifth floor by the right lift is over later, though it stands less."""
    route = follow(clock, 4)
    assert any(leg.action is LegAction.STAND and leg.track == 5 for leg in route.legs)
    around = [
        follow(clock, 4, *(place for ride in rides for place in (aboard(ride, ride.from_floor), aboard(ride, 5))))
        for rides in ((Ride(RIGHT, 1, 5),), (Ride(LEFT, 1, 3), Ride(RIGHT, 3, 5)))
    ]
    assert route.finish_us + 2 * SECOND < min(one.finish_us for one in around)


@pytest.mark.parametrize("clearance", [3, 4])
def test_p44_it_passes_no_place_before_mralpha_has_left_the_one_a_clearance_ahead(clearance: int) -> None:
    route = follow(FAST, clearance)
    last_run = route.legs[-2]
    windows = itinerary_windows(park(FAST, 0), alpha_plan(FAST), 0)
    left_us = {w.segment.index: w.to_us for w in windows if w.segment.track == 5}  # the last window counts
    for index in range(last_run.from_index + 1, 12):
        if index + clearance <= PLACES:
            arrival_us = last_run.begin_us + (index - last_run.from_index) * SECOND
            assert arrival_us >= left_us[index + clearance]
    # It follows as a moving body does: it is under way long before MRalpha has left the floor.
    assert last_run.begin_us < left_us[PLACES] - 5 * SECOND


def test_p44_real_carriers_wait_a_place_farther_off_and_pass_at_speed() -> None:
    assert [stops(follow(REAL, clearance))[3] for clearance in (4, 3)] == [("TRAVEL", 5, 3), ("TRAVEL", 5, 4)]


@pytest.mark.parametrize("clock", [FAST, REAL])
@pytest.mark.parametrize("clearance", [1, 2, 3, 4])
def test_p40_windows_and_uses_of_both_never_meet(clock: Clock, clearance: int) -> None:
    site = park(clock, clearance - 1)
    plan = itinerary(LAMBDA, list(follow(clock, clearance).legs))
    reservations = reserved(clock)
    assert reservations.conflicts(LAMBDA, itinerary_windows(site, plan, 0)) == []
    for use in lift_uses(site, plan, 0):
        assert all(are_compatible(site, use, other) for other in reservations.uses(use.lift_track, LAMBDA))


# --- the eight itineraries --------------------------------------------------------------------------------------------


def test_p37_eight_itineraries_from_the_first_to_the_fifth_floor() -> None:
    found = lift_itineraries(park(FAST, 0), 1, 5)
    straight = [(Ride(lift, 1, 5),) for lift in (LEFT, RIGHT)]
    crossing = [
        (Ride(lift, 1, middle), Ride(other, middle, 5))
        for lift, other in ((LEFT, RIGHT), (RIGHT, LEFT))
        for middle in (2, 3, 4)
    ]
    assert found == straight + crossing
    assert len(found) == 8


@pytest.mark.parametrize("floors", range(2, 9))
def test_p37_their_number_on_any_number_of_floors(floors: int) -> None:
    site = park(FAST, 0, floors)
    assert len(lift_itineraries(site, 1, floors)) == 2 + 2 * (floors - 2)
    assert len(lift_itineraries(site, 1, 1)) == 1 + 2 * (floors - 1)
    assert lift_itineraries(site, 1, 1, crossings=0) == [()]


def aboard(ride: Ride, floor: int) -> Segment:
    return Segment(floor, 0 if ride.lift_track == LEFT else PLACES + 1)


@pytest.mark.parametrize("rides", lift_itineraries(park(FAST, 0), 1, 5), ids=lambda rides: str(len(rides)))
def test_p37_the_planner_finds_each_of_the_eight_where_the_others_are_blocked(rides: tuple[Ride, ...]) -> None:
    """Somebody stands for ever on the way to the lift at the other end, and on the alleys of the other floors."""
    away = {LEFT: Segment(1, 12), RIGHT: Segment(1, 2)}[rides[0].lift_track]
    back = {LEFT: Segment(5, 14), RIGHT: Segment(5, 3)}[rides[-1].lift_track]
    crossed = {ride.to_floor for ride in rides[:-1]}
    standing = [away, back, *(Segment(floor, 8) for floor in (2, 3, 4) if floor not in crossed)]
    reservations = Reservations()
    for owner, segment in enumerate(standing, start=ALPHA):
        reservations.reserve(owner, [SlotWindow(segment, 0, FOREVER)])
    visits = (Visit(GOAL, FAST.work_us),)
    route = plan_route(park(FAST, 0), reservations, LAMBDA, START, 0, visits, frozenset({GOAL}), 4_000)
    assert isinstance(route, Route)
    found = [Ride(leg.track, leg.from_index, leg.to_index) for leg in route.legs if leg.action is LegAction.RIDE]
    assert tuple(found) == rides


@pytest.mark.parametrize("clock", [FAST, REAL])
def test_p46_the_plan_is_the_earliest_of_all_eight(clock: Clock) -> None:
    finishes_us = {
        rides: follow(
            clock, 4, *(position for r in rides for position in (aboard(r, r.from_floor), aboard(r, r.to_floor)))
        ).finish_us
        for rides in lift_itineraries(park(clock, 3), 1, 5)
    }
    assert len(finishes_us) == 8 and len(set(finishes_us.values())) >= 3
    assert follow(clock, 4).finish_us == min(finishes_us.values())
    assert min(finishes_us, key=lambda rides: finishes_us[rides]) == (Ride(LEFT, 1, 5),)

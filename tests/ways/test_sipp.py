import math
import random
from itertools import pairwise

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.occupancy import itinerary_windows, travel_windows
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow
from onboard.ways.sipp import NoRoute, Route, RouteLeg, Visit, free_flow_us, plan_route
from onboard.ways.site import Axis, WaySite
from tests.ways.lines import ALLEY, SPUR, line_site

CARRIER = Axis(1_500, 500)
SECOND = 1_000_000
MYSELF = 11
OTHER = 12
BOUND = 4_000


def alley(length: int = 12, spur_at: int | None = None) -> CarPark:
    return line_site(length, 2_400, CARRIER, 2_300, 50, spur_at)


def p(index: int) -> Segment:
    return Segment(ALLEY, index)


def everywhere(site: WaySite) -> frozenset[Segment]:
    return frozenset(Segment(t.number, i) for t in site.tracks.values() for i in range(1, t.length + 1))


def planned(
    site: WaySite,
    reservations: Reservations,
    start: Segment,
    *visits: Visit,
    start_us: int = 0,
    refuges: frozenset[Segment] | None = None,
    owner: int = MYSELF,
) -> Route:
    route = plan_route(
        site, reservations, owner, start, start_us, visits, everywhere(site) if refuges is None else refuges, BOUND
    )
    assert isinstance(route, Route), route
    return route


def windows_of(site: WaySite, route: Route, start: Segment, start_us: int = 0) -> list[SlotWindow]:
    """What all other machines conclude from the itinerary on the wire."""
    legs = [
        Leg(one.action, one.track, one.from_index, one.to_index, Side.NEAR, to_bus_ms(one.end_us)) for one in route.legs
    ] or [Leg(LegAction.STAND, start.track, start.index, start.index, Side.NEAR, to_bus_ms(start_us))]
    itinerary = Itinerary(MYSELF, 1, Grade.FIRM, Stamp(to_bus_ms(start_us), 1, 1), tuple(legs))
    return itinerary_windows(site, itinerary, start_us)


def occupied(segment: Segment, from_s: float, to_s: float) -> SlotWindow:
    return SlotWindow(segment, int(from_s * SECOND), FOREVER if to_s == float("inf") else int(to_s * SECOND))


def run_us(segments: int) -> int:
    return run_duration_us(segments * 2_400, CARRIER)


def test_with_nobody_in_the_way_one_takes_the_car_and_brings_it() -> None:
    site = alley()
    visits = (Visit(p(4), 9 * SECOND), Visit(p(9), 7 * SECOND))
    route = planned(site, Reservations(), p(12), *visits)
    first, second = run_us(8) + 9 * SECOND, run_us(8) + run_us(5) + 16 * SECOND
    assert route.legs == (
        RouteLeg(LegAction.TRAVEL, ALLEY, 12, 4, 0, run_us(8)),
        RouteLeg(LegAction.WORK, ALLEY, 4, 4, run_us(8), first),
        RouteLeg(LegAction.TRAVEL, ALLEY, 4, 9, first, first + run_us(5)),
        RouteLeg(LegAction.WORK, ALLEY, 9, 9, first + run_us(5), second),
    )
    assert route.visit_ends_us == (first, second)
    assert route.finish_us == second == free_flow_us(site, p(12), 0, visits)


def test_after_the_last_visit_one_drives_to_the_nearest_refuge() -> None:
    route = planned(alley(), Reservations(), p(1), Visit(p(4), SECOND), refuges=frozenset({p(1), p(6), p(12)}))
    assert route.legs[-1].to_index == 6
    assert route.finish_us == route.legs[-1].begin_us


def test_one_stays_where_it_is_a_refuge() -> None:
    assert planned(alley(), Reservations(), p(3)).legs == ()


def test_times_given_in_microseconds_become_whole_milliseconds() -> None:
    visits = (Visit(p(2), 1_500_001, not_before_us=7_000_001),)
    route = planned(alley(), Reservations(), p(1), *visits, start_us=999)
    stand, work = route.legs[1:]
    assert route.legs[0].begin_us == 1_000
    assert (stand.action, work.action) == (LegAction.STAND, LegAction.WORK)
    assert (work.begin_us, work.end_us) == (7_001_000, 8_502_000)
    assert free_flow_us(alley(), p(1), 999, visits) == 8_502_000


def test_waiting_beats_giving_up_where_the_way_is_free_soon() -> None:
    # Row P38: obstacles are temporary.
    reservations = Reservations()
    reservations.reserve(OTHER, [occupied(p(5), 0, 20)])
    route = planned(alley(), reservations, p(1), Visit(p(8), SECOND))
    assert [leg.action for leg in route.legs[-2:]] == [LegAction.TRAVEL, LegAction.WORK]
    last_run = route.legs[-2]
    assert last_run.begin_us < 20 * SECOND < last_run.end_us
    # It sets off from where it waits so that its front is at p(1,5) just as that is free.
    entered = min(w.from_us for w in windows_of(alley(), route, p(1)) if w.segment == p(5))
    assert 20 * SECOND <= entered < 20 * SECOND + 1_000


def test_a_spur_is_where_one_lets_the_other_pass() -> None:
    site = alley(8, spur_at=4)
    reservations = Reservations()
    leader = travel_windows(site, p(8), 1, 15 * SECOND, 15 * SECOND + run_us(7))
    stays = [occupied(p(8), 0, 15), SlotWindow(p(1), 15 * SECOND + run_us(7), FOREVER)]
    reservations.reserve(OTHER, leader + stays)
    route = planned(site, reservations, p(2), Visit(p(6), SECOND), refuges=frozenset({p(6)}))
    assert SPUR in {leg.track for leg in route.legs}
    assert reservations.conflicts(MYSELF, windows_of(site, route, p(2))) == []


def test_a_route_that_sets_off_through_a_junction_tells_where_it_stands() -> None:
    site = alley(8, spur_at=4)
    route = planned(site, Reservations(), p(4), refuges=frozenset({Segment(SPUR, 1)}))
    hop_us = run_us(1)
    assert route.legs == (
        RouteLeg(LegAction.STAND, ALLEY, 4, 4, 0, 0),
        RouteLeg(LegAction.TRAVEL, SPUR, 1, 1, 0, hop_us),
    )
    assert SlotWindow(p(4), 0, hop_us) in windows_of(site, route, p(4))


def test_free_flow_knows_the_way_through_spurs_and_what_is_out_of_reach() -> None:
    site = alley(8, spur_at=4)
    inside = Segment(SPUR, 1)
    assert free_flow_us(site, p(8), 0, (Visit(inside, 0),)) == run_us(4) + run_us(1)
    assert free_flow_us(site, inside, 0, (Visit(p(1), SECOND),)) == run_us(1) + run_us(3) + SECOND
    for nowhere in (p(9), p(0), Segment(2, 1), Segment(128, 1)):
        assert free_flow_us(site, p(1), 0, (Visit(nowhere, 0),)) == FOREVER
        assert isinstance(
            plan_route(site, Reservations(), 1, p(1), 0, (Visit(nowhere, 0),), everywhere(site), 9), NoRoute
        )
        assert isinstance(plan_route(site, Reservations(), 1, nowhere, 0, (), everywhere(site), 9), NoRoute)


# --- following (row P44) ----------------------------------------------------------------------------------------------


def crossing_us(border_mm: float, distance_mm: float) -> float:
    """When a run over ``distance_mm`` has come as far as ``border_mm``, both from its start; in floating point."""
    speed, acceleration = CARRIER.speed_mm_s, CARRIER.acceleration_mm_s2
    ramp_mm, ramp_s = speed**2 / 2 / acceleration, speed / acceleration
    if border_mm <= ramp_mm:
        return float((2 * max(0.0, border_mm) / acceleration) ** 0.5 * 1e6)
    if border_mm <= distance_mm - ramp_mm:
        return float((ramp_s / 2 + border_mm / speed) * 1e6)
    rest_mm = distance_mm - min(border_mm, distance_mm)
    return float((distance_mm / speed + ramp_s - (2 * rest_mm / acceleration) ** 0.5) * 1e6)


def test_a_follower_departs_exactly_a_headway_behind() -> None:
    site = alley(30)
    leader_us = 4 * SECOND
    reservations = Reservations()
    leader = travel_windows(site, p(3), 30, leader_us, leader_us + run_us(27))
    reservations.reserve(OTHER, [occupied(p(3), 0, 4), *leader, SlotWindow(p(30), leader_us + run_us(27), FOREVER)])
    route = planned(site, reservations, p(1), Visit(p(28), SECOND), refuges=frozenset({p(28)}))

    # By hand: both run 27 segments, the leader 2 segments ahead; in each segment the follower's front (1,200 mm ahead
    # of its centre) may pass the near border once the leader's rear has passed the far one.
    distance_mm, half_mm = 27 * 2_400, 1_200
    headway_us = max(
        leader_us
        + crossing_us((segment - 3) * 2_400 + 1_200 + half_mm, distance_mm)
        - crossing_us((segment - 1) * 2_400 - 1_200 - half_mm, distance_mm)
        for segment in range(3, 29)
    )
    departure = route.legs[-2]
    assert (departure.from_index, departure.to_index) == (1, 28)
    assert 0 <= departure.begin_us - headway_us < 1_001
    assert departure.end_us == departure.begin_us + run_us(27)
    # That is while the leader is still under way, and a millisecond earlier would be too early.
    assert departure.begin_us < leader_us + run_us(27) // 2
    early = travel_windows(site, p(1), 28, departure.begin_us - 1_000, departure.end_us - 1_000)
    assert reservations.conflicts(MYSELF, early)


# --- when there is none -----------------------------------------------------------------------------------------------


def none(site: WaySite, reservations: Reservations, start: Segment, *visits: Visit, bound: int = BOUND) -> NoRoute:
    answer = plan_route(site, reservations, MYSELF, start, 0, visits, everywhere(site), bound)
    assert isinstance(answer, NoRoute)
    return answer


def test_no_route_past_a_machine_that_stands_for_ever() -> None:
    reservations = Reservations()
    reservations.reserve(OTHER, [occupied(p(5), 30, float("inf"))])
    assert "no order of waits and moves" in none(alley(), reservations, p(8), Visit(p(5), 40 * SECOND)).reason
    # Behind it, the refuge would be out of reach once the visit is over.
    assert planned(alley(), reservations, p(8), Visit(p(4), 40 * SECOND)).legs[-1].to_index == 4
    kept = frozenset({p(9)})
    assert isinstance(
        plan_route(alley(), reservations, MYSELF, p(8), 0, (Visit(p(4), 40 * SECOND),), kept, BOUND), NoRoute
    )


def test_no_route_from_where_another_stands() -> None:
    reservations = Reservations()
    reservations.reserve(OTHER, [occupied(p(8), 0, 5)])
    assert none(alley(), reservations, p(8), Visit(p(5), 0)).reason == (
        "the start p(1,8) is reserved by another machine"
    )


def test_the_search_ends_at_its_bound_of_expansions() -> None:
    reservations = Reservations()
    reservations.reserve(OTHER, [occupied(p(5), 0, 20)])
    answer = none(alley(), reservations, p(1), Visit(p(8), SECOND), bound=3)
    assert (answer.reason, answer.expansions) == ("the search's bound of expansions is reached", 3)


# --- a fleet ----------------------------------------------------------------------------------------------------------

GRID_US = 100_000
LONG_US = 300 * SECOND


def travelled_mm(time_us: int, distance_mm: int) -> float:
    speed, acceleration = float(CARRIER.speed_mm_s), float(CARRIER.acceleration_mm_s2)
    top = min(speed, math.sqrt(distance_mm * acceleration))
    end_s = distance_mm / top + top / acceleration if distance_mm else 0.0
    time_s = min(time_us / 1e6, end_s)
    if time_s * acceleration <= top:
        return acceleration * time_s**2 / 2
    if (end_s - time_s) * acceleration <= top:
        return distance_mm - acceleration * (end_s - time_s) ** 2 / 2
    return top * time_s - top**2 / acceleration / 2


def centres_mm(legs: tuple[RouteLeg, ...]) -> list[float]:
    """Where the carrier's centre is at each instant of a grid, by the equations of motion."""
    centres = []
    remaining = list(legs)
    for time_us in range(0, LONG_US, GRID_US):
        while len(remaining) > 1 and remaining[0].end_us <= time_us:
            remaining.pop(0)
        leg = remaining[0]
        sign = 1 if leg.to_index > leg.from_index else -1
        distance_mm = abs(leg.to_index - leg.from_index) * 2_400
        centres.append((leg.from_index - 1) * 2_400 + sign * travelled_mm(time_us - leg.begin_us, distance_mm))
    return centres


@pytest.mark.parametrize("seed", range(5))
def test_machines_that_plan_one_after_the_other_never_touch(seed: int) -> None:
    # Bumper to bumper at first; from right to left each works, and ends, behind where the one before ends.
    rng = random.Random(f"fleet {seed}")
    site = alley(30)
    homes = {14: p(9), 13: p(8), 12: p(7), 11: p(6)}
    reservations = Reservations()
    for node, home in homes.items():
        reservations.reserve(node, [SlotWindow(home, 0, FOREVER)])
    paths: list[list[float]] = []
    limit, waited = 31, 0
    for node, home in homes.items():
        last = rng.randint(home.index + 2, limit - 1)
        visits = (Visit(p(limit - 1), rng.randrange(10) * SECOND), Visit(p(last), rng.randrange(10) * SECOND))
        route = planned(site, reservations, home, *visits, owner=node, refuges=frozenset({p(last)}))
        reservations.release(node)
        reservations.reserve(node, windows_of(site, route, home))
        paths.append(centres_mm(route.legs))
        waited += route.finish_us > free_flow_us(site, home, 0, visits)
        limit = last
    assert waited >= 1
    for ahead, behind in pairwise(paths):
        gap_mm = min(one - other for one, other in zip(ahead, behind, strict=True))
        assert gap_mm >= 2_300 + 2 * 50 - 0.01


def test_a_run_up_may_be_faster_than_a_standing_start() -> None:
    # What the exhaustive search finds too: from one segment back one passes the former start at speed.
    reservations = Reservations()
    reservations.reserve(OTHER, [occupied(p(4), 0, 30)])
    route = planned(alley(), reservations, p(3), Visit(p(9), SECOND))
    waits_at = route.legs[-2].from_index
    assert waits_at < 3
    standing_start_us = 30 * SECOND + run_us(6) + SECOND
    assert route.finish_us < standing_start_us

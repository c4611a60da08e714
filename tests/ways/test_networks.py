"""Networks of every form: what is reached, where machines rest, and plans that never meet (rows P37, P38, P44)."""

import random
from collections.abc import Callable

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Stamp
from onboard.core.site import Segment, Station
from onboard.systems.car_park.program import CarStep, Program, to_itinerary
from onboard.systems.car_park.site import CarPark, SizeClass, class_of_end, open_end
from onboard.ways.floor_plan import Mismatch, Point, at_mm, floor_plan
from onboard.ways.lift_uses import are_compatible
from onboard.ways.occupancy import final_position, itinerary_windows, leg_windows, lift_uses
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.reservations import FOREVER, Reservations
from onboard.ways.roads import roads_of
from onboard.ways.room import reachable, resting_room
from onboard.ways.sipp import Route, Visit, plan_route
from onboard.ways.site import BayUse
from tests.ways.networks import alley, at, branched, drawn, in_line, network, ring, spur

SECOND_US = 1_000_000
SEEDS = range(60)
BUILDINGS: dict[str, Callable[[], CarPark]] = {
    "ring": ring,
    "one-way ring": lambda: ring(1),
    "lift in line": in_line,
    "branches": branched,
}


def planned(
    site: CarPark,
    taken: Reservations,
    node: int,
    start: Segment,
    start_us: int,
    visits: tuple[Visit, ...],
    rests: frozenset[Segment],
) -> Itinerary:
    """A plan as it goes on the wire; fails the test where there is none."""
    route = plan_route(site, taken, node, start, start_us, visits, rests, 20_000)
    assert isinstance(route, Route), (start, visits, route)
    steps = [
        CarStep(leg.action, leg.track, leg.from_index, leg.to_index, leg.begin_us, leg.end_us) for leg in route.legs
    ]
    stamp = Stamp(start_us // 1000, 1, node)
    return to_itinerary(node, 1, Grade.FIRM, stamp, steps or [_stand(start, start_us)])


def _stand(here: Segment, at_us: int) -> CarStep:
    return CarStep(LegAction.STAND, here.track, here.index, here.index, at_us, at_us + 1000)


@pytest.mark.parametrize("name", BUILDINGS)
def test_every_place_is_reached_and_left_from_the_bay_by_one_that_is_alone(name: str) -> None:
    site = BUILDINGS[name]()
    assert floor_plan(site).mismatches == ()
    assert reachable(site).lost_places == reachable(site).no_way_out == ()
    (bay,) = site.fronts(*BayUse)
    for place in site.places[::3]:
        visits = Visit(place.segment, SECOND_US), Visit(bay, SECOND_US)
        planned(site, Reservations(), 20, bay, 0, visits, refuges(site))


@pytest.mark.parametrize("seed", SEEDS)
def test_any_building_closes_and_is_reached_and_has_room(seed: int) -> None:
    site = drawn(seed)
    assert floor_plan(site).mismatches == ()
    assert reachable(site).lost_places == reachable(site).no_way_out == ()
    assert resting_room(site).slots


@pytest.mark.parametrize("seed", SEEDS)
def test_plans_made_one_after_the_other_never_meet_and_wait_in_no_circle(seed: int) -> None:
    site, chance = drawn(seed), random.Random(seed)
    homes = dict(zip((20, 21, 22), resting_room(site).slots, strict=False))
    (bay,) = site.fronts(*BayUse)
    taken, plans = Reservations(), {}
    for node, home in homes.items():
        plans[node] = to_itinerary(node, 1, Grade.FIRM, Stamp(0, 1, node), [_stand(home, 0)])
        taken.reserve(node, itinerary_windows(site, plans[node], 0), lift_uses(site, plans[node], 0))
    for node, home in homes.items():
        ends = [final_position(site, plan) for other, plan in plans.items() if other != node]
        others = [one for one in ends if one is not None]
        rests = open_refuges(site, others)
        # Who rests on a track serves its places, or gives way first.
        place = chance.choice([one for one in site.places if one.track not in {other.track for other in others}])
        plan = planned(site, taken, node, home, 0, (Visit(bay, SECOND_US), Visit(place.segment, SECOND_US)), rests)
        windows, uses = itinerary_windows(site, plan, 0), lift_uses(site, plan, 0)
        taken.release(node)
        assert taken.conflicts(node, windows) == []
        for one in uses:
            assert all(are_compatible(site, one, use) for use in taken.uses(one.lift_track, node))
        taken.reserve(node, windows, uses)
        plans[node] = plan
    assert not _waits_in_a_circle(site, plans)


def _waits_in_a_circle(site: CarPark, plans: dict[int, Itinerary]) -> bool:
    """Whether the order in which plans pass slots, together with the order of each plan's legs, has a circle."""
    turns: dict[Segment, list[tuple[int, int, int]]] = {}
    before: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for node, plan in plans.items():
        for number, windows in enumerate(leg_windows(site, plan, 0)):
            before[node, number] = {(node, number - 1)} if number else set()
            for window in windows:
                turns.setdefault(window.segment, []).append((window.from_us, node, number))
    for passed in turns.values():
        for (_, one, leg), (_, other, behind) in zip(sorted(passed), sorted(passed)[1:], strict=False):
            if one != other:
                before[other, behind].add((one, leg + 1) if (one, leg + 1) in before else (one, leg))
    done: set[tuple[int, int]] = set()
    while True:
        ready = {step for step, needs in before.items() if step not in done and needs <= done}
        if not ready:
            return len(done) < len(before)
        done |= ready


@pytest.mark.parametrize("name", BUILDINGS)
def test_a_plan_told_anew_in_the_middle_occupies_what_it_did(name: str) -> None:
    site = BUILDINGS[name]()
    (bay,), chance = site.fronts(*BayUse), random.Random(name)
    for place in chance.sample(site.places, 6):
        visits = Visit(place.segment, SECOND_US), Visit(bay, SECOND_US)
        route = plan_route(site, Reservations(), 20, bay, 0, visits, refuges(site), 20_000)
        assert isinstance(route, Route)
        steps = [CarStep(*leg) for leg in route.legs]
        whole = leg_windows(site, to_itinerary(20, 1, Grade.FIRM, Stamp(0, 1, 1), steps), 0)
        program = Program(site)
        program.begin(bay, steps, Stamp(0, 1, 1))
        for number, step in enumerate(steps):
            program.replace(program.remaining, program.stamp)
            told = program.itinerary(20, step.begin_us)
            rest = leg_windows(site, told, step.begin_us, step.begin_us)
            assert [windows for windows in rest if windows] == [windows for windows in whole[number:] if windows]
            program.over()


def test_resting_machines_cut_nobody_off() -> None:
    site = branched()
    assert resting_room(site).stretches[2] == tuple(at(2, index) for index in range(1, 6))
    # The stub before the lift is the only way up, and the alley before the bay is everybody's.
    assert {track for track, _ in resting_room(site).refused} == {1, 192}
    assert resting_room(ring(1)).slots == (at(192, 1),)
    assert {slot.track for slot in resting_room(ring()).slots} == {2, 192}
    assert open_refuges(site, [at(2, 3)]) == {at(3, n) for n in (1, 2, 3)} | {at(4, n) for n in (1, 2, 3, 4, 5)}


def test_places_behind_a_one_way_alley_without_a_way_back_are_named() -> None:
    bay = (Station(1, 2, Side.NEAR),)
    trap = network(alley(1, 6), alley(2, 3, at(1, 5), one_way=1), bays=bay)
    assert {str(place.segment) for place in reachable(trap).no_way_out} == {"p(2,1)", "p(2,2)", "p(2,3)"}
    island = network(alley(1, 6), alley(2, 3, at(1, 5), one_way=-1), bays=bay)
    assert {str(place.segment) for place in reachable(island).lost_places} == {"p(2,1)", "p(2,2)", "p(2,3)"}


def test_a_ring_that_does_not_close_is_told_with_both_places() -> None:
    open_ring = network(
        alley(1, 8),
        alley(2, 4, at(1, 8)),
        alley(3, 6, at(2, 4)),
        alley(4, 3, at(3, 6), at(1, 1)),
        bays=(Station(1, 3, Side.NEAR),),
    )
    (told,) = floor_plan(open_ring).mismatches
    assert told == Mismatch(4, at(1, 1), Point(2_400, 0), Point(0, 0))


def test_everything_has_a_place_in_mm() -> None:
    site = in_line()
    plan = floor_plan(site)
    assert at_mm(plan, site, at(1, 6)) == at_mm(plan, site, at(2, 0)) == plan.shafts[128]
    site = branched()
    plan = floor_plan(site)
    assert at_mm(plan, site, at(2, 1)) == (7_200, 2_400) and at_mm(plan, site, at(3, 1)) == (7_200, -2_400)


def test_only_what_is_not_straight_has_its_own_tape() -> None:
    assert not network(alley(1, 6), spur(192, 1, at(1, 4)), bays=(Station(1, 2, Side.NEAR),)).is_charted
    site = drawn(3)
    for track in site.tracks.values():
        if track.number not in site.lifts:
            for index in range(track.length + 2):
                told = site.on_tape(track.origin_mm + (index - 1) * track.pitch_mm)
                assert told == (track.number, (index - 1) * track.pitch_mm)


def test_a_car_goes_where_every_car_of_its_class_fits() -> None:
    site = in_line()
    small, tall = SizeClass("small", 4_000, 1_600, 1_800), SizeClass("tall", 5_300, 2_100, 3_000)
    low, high = site.places[0], site.places[1]
    site.__dict__.update(classes=(small, tall), place_class={low.number: 1, high.number: 2})
    assert [site.car_class(*car) for car in ((3_900, 1_500, 1_000), (3_900, 1_900, 1_000), (6_000, 1_500, 900))] == [
        1,
        2,
        0,
    ]
    assert [site.takes(low, one) for one in (0, 1, 2)] == [False, True, False]
    assert [site.takes(high, one) for one in (0, 1, 2)] == [False, True, True]
    assert [class_of_end(open_end(one)) for one in (0, 1, 15)] == [0, 1, 15] and class_of_end(high.number) is None


@pytest.mark.parametrize("site", [branched(), ring(one_way=1)], ids=["branched", "one way"])
def test_from_where_no_carrier_rests_no_way_leads_and_nothing_is_raised(site: CarPark) -> None:
    """A robot that stopped amid its hop into a branch of one position stands at index 0 (drawn car parks, 3380).

    Where ways are one-way each robot with nothing to do halted at that word (4359).
    """
    roads, goal = roads_of(site), min(refuges(site))
    beyond = [Segment(track.number, index) for track in site.tracks.values() for index in (0, track.length + 1, 255)]
    outside = [one for one in beyond if not roads.knows(one)]
    assert outside and {roads.shortest_us(one, goal) for one in outside} == {FOREVER}

"""Which place a robot takes, by the site's ``place``: what each costs beside the time at which a car stands there."""

from collections import Counter
from dataclasses import replace

import pytest

from onboard.config.site import parse_site
from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CallForProposals, CarAt, Reference
from onboard.core.site import Segment, Station
from onboard.systems.car_park.fetch_costs import fetch_us, moved_from
from onboard.systems.car_park.place_costs import GAIN_US, OFF_US, RANK_US, PlaceCosts
from onboard.systems.car_park.site import CarPark, DeskPolicy, PlacePolicy, car_park
from onboard.systems.car_park.stays import HOUR_US, Stays

TEXT = """
[site]
name = "places"
[floors]
count = 3
positions = 8
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,3)"
[[compartments]]
name = "IOC2"
node = 2
at = "p(1,7)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[robots]]
name = "MR1"
node = 11
home = "p(2,8)"
[[robots]]
name = "MR2"
node = 12
home = "p(3,8)"
"""
SITE = car_park(parse_site(TEXT, "places.toml"))


def parking(number: int, origin: int = 1, source: int | None = None) -> CallForProposals:
    car = Reference(origin, number)
    bay = SITE.compartments[origin].number if source is None else source
    ends = bay, ANY_STATION
    return CallForProposals(
        origin, 7, car, Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, 1_000, *ends, car, 2_700
    )


def by(place: PlacePolicy, **words: object) -> CarPark:
    return replace(SITE, place=place, **words)  # type: ignore[arg-type]  # any field of the site


def best(costs: PlaceCosts, call: CallForProposals, free: list[Station], now_us: int = 0) -> Station:
    """The place that costs least, the first of the site's order where several do."""
    told = costs.of(call, free, now_us)
    return min(free, key=lambda one: told.get(one.number, 0))


def test_the_nearest_place_needs_no_costs() -> None:
    assert PlaceCosts(SITE).of(parking(1), list(SITE.places), 0) == {}


def test_a_fetch_costs_more_from_a_higher_floor_and_is_of_the_way_to_the_desks() -> None:
    floors = [fetch_us(SITE, Segment(floor, 5), 1) for floor in (1, 2, 3)]
    assert floors == sorted(floors) and len(set(floors)) == 3
    beside = Segment(1, 3)
    own, near, any_desk = (
        by(PlacePolicy.COST, desk=one) for one in (DeskPolicy.OWN, DeskPolicy.NEAREST, DeskPolicy.ANY)
    )
    assert fetch_us(own, beside, 1) == fetch_us(near, beside, 2)
    assert fetch_us(near, beside, 2) < fetch_us(any_desk, beside, 1) < fetch_us(own, beside, 2)


def test_the_cheapest_place_is_that_with_the_cheapest_fetch() -> None:
    costs = PlaceCosts(by(PlacePolicy.COST, desk=DeskPolicy.OWN))
    assert best(costs, parking(1, origin=2), list(SITE.places)).segment == Segment(1, 7)
    assert best(costs, parking(1, origin=1), list(SITE.places)).segment != Segment(1, 7)


def test_all_robots_draw_the_same_place_and_each_car_its_own() -> None:
    free = list(SITE.places)
    one, other = PlaceCosts(by(PlacePolicy.RANDOM)), PlaceCosts(by(PlacePolicy.RANDOM))
    found = [best(one, parking(number), free) for number in range(1, 41)]
    assert found == [best(other, parking(number), free) for number in range(1, 41)]
    drawn = Counter(place.track for place in found)
    assert set(drawn) == {1, 2, 3} and len(set(found)) > 20
    assert sorted(one.of(parking(1), free, 0).values())[:2] == [0, RANK_US], "an order, which no way outweighs"


def test_balanced_places_are_in_the_alley_that_is_least_full() -> None:
    costs, free = PlaceCosts(by(PlacePolicy.BALANCED)), list(SITE.places)
    tracks = []
    for number in range(1, 7):
        place = best(costs, parking(number), free)
        free.remove(place)
        tracks.append(place.track)
    assert Counter(tracks) == {1: 2, 2: 2, 3: 2}


def heard(stays: Stays, number: int, came_us: int, stayed_us: int) -> None:
    place = SITE.places[0].number
    stays.hear(CarAt(5, Reference(1, number), place, 1, 2_700), came_us)
    stays.hear(CarAt(5, Reference(1, number), place, 1, 2_700), came_us + 60_000_000)
    stays.hear(CarAt(1, Reference(1, number), OUTSIDE, 2, 2_700), came_us + stayed_us)


def learned() -> PlaceCosts:
    """Who comes at eight stays for nine hours, who comes at noon for one, up to forty at a time."""
    costs = PlaceCosts(by(PlacePolicy.STAY))
    for number in range(1, 5):
        heard(costs.stays, number, 8 * HOUR_US + number, 9 * HOUR_US)
        heard(costs.stays, 100 + number, 12 * HOUR_US + number, HOUR_US)
    costs.stays.most = 40
    return costs


def test_short_stays_are_near_and_long_ones_far() -> None:
    costs, free = learned(), list(SITE.places)
    assert costs.stays.expected_us(32 * HOUR_US) == 9 * HOUR_US, "people's days are alike"
    assert costs.stays.expected_us(12 * HOUR_US) == HOUR_US
    assert costs.stays.expected_us(20 * HOUR_US) == 5 * HOUR_US, "of an hour without cars the mean of all"
    cheap = {at: fetch_us(SITE, best(costs, parking(1), free, at * HOUR_US).segment, 1) for at in (12, 32)}
    assert cheap[12] == min(fetch_us(SITE, one.segment, 1) for one in free)
    order = sorted(fetch_us(SITE, one.segment, 1) for one in free)
    assert cheap[32] == order[20], "half of all stays are shorter: the middle of the forty places that are needed"
    assert sorted(costs.of(parking(1), free, 0).values())[1] == OFF_US


def test_before_anything_is_known_all_stays_are_short() -> None:
    costs, free = PlaceCosts(by(PlacePolicy.STAY)), list(SITE.places)
    assert costs.stays.expected_us(0) is None
    assert fetch_us(SITE, best(costs, parking(1), free).segment, 1) == min(fetch_us(SITE, p.segment, 1) for p in free)


def test_only_by_stay_is_anything_learned() -> None:
    costs = PlaceCosts(SITE)
    costs.hear(CarAt(5, Reference(1, 1), SITE.places[0].number, 1, 2_700), 0)
    assert costs.stays.most == 0


@pytest.mark.parametrize("place", PlacePolicy)
def test_a_car_is_moved_only_to_where_its_fetch_is_cheaper(place: PlacePolicy) -> None:
    costs, source = PlaceCosts(by(place)), Station(3, 6, SITE.places[0].side)
    call = parking(1, source=source.number)
    assert moved_from(SITE, call) == source and moved_from(SITE, parking(1)) is None
    here_us = fetch_us(SITE, source.segment, 1)
    nearer = costs.nearer(call, list(SITE.places))
    assert nearer and all(fetch_us(SITE, one.segment, 1) <= here_us - GAIN_US for one in nearer)
    assert best(costs, call, nearer).track == 1, "and to the cheapest of these, whatever else the site says"
    assert costs.nearer(parking(1), list(SITE.places)) == list(SITE.places)

"""A car is left only where it can be fetched from: an itinerary tells 31 legs, and a ring may ask for more."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site
from onboard.core.site import Segment
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.report import lines
from onboard.systems.car_park.site import car_park


def test_on_a_ring_no_car_is_left_where_no_plan_could_tell_the_way_to_fetch_it() -> None:
    """On the shipped day 44 of 82 drivers waited for ever for cars on the upper floor, and no robot bid."""
    site = car_park(find_site("ring"))
    used = {place.segment for place in to_fetch_from(site, site.places)}
    assert Segment(2, 12) not in used, "36 legs: round the upper floor to the lift, round the lower one to the exit"
    assert {Segment(1, 5), Segment(2, 1)} <= used
    assert any("of them are not used, as no itinerary can tell the way" in line for line in lines(site))


@pytest.mark.parametrize("name", ["small", "corner", "hoboken"])
def test_elsewhere_every_place_is_used(name: str) -> None:
    site = car_park(find_site(name))
    assert to_fetch_from(site, site.places) == list(site.places)


def test_a_lone_robot_of_a_ring_may_rest_in_more_places() -> None:
    site = car_park(find_site("ring"))
    second = next(node for node, machine in site.machines.items() if machine.name == "MR2")
    lone = replace(site, machines={node: one for node, one in site.machines.items() if node != second})
    assert len(to_fetch_from(lone, lone.places)) >= len(to_fetch_from(site, site.places))

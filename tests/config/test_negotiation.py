"""``[negotiation]`` of a site file."""

import pytest

from onboard.config.problems import ConfigError
from onboard.systems.car_park.site import DeskPolicy, PlacePolicy, RestAt, RideCalls
from tests.sites import one_floor


def test_rides_are_planned_unless_the_site_says_that_lifts_are_asked_before() -> None:
    assert one_floor().rides is RideCalls.PLANNED
    assert one_floor().timing.sub_call_percent == 50
    site = one_floor(extra='[negotiation]\nrides = "before"\nsub_call_percent = 30\n')
    assert (site.rides, site.timing.sub_call_percent) == (RideCalls.BEFORE, 30)
    assert site.digest != one_floor().digest, "machines that ask at different times do not bid together"


def test_bids_keep_their_itineraries_unless_the_site_says_otherwise() -> None:
    assert not one_floor().tells_offers
    assert one_floor(extra='[negotiation]\noffers = "told"\n').tells_offers


def test_robots_wait_in_the_nearest_refuge_unless_the_site_says_where_calls_are_likely() -> None:
    assert one_floor().rest_at is RestAt.NEAREST
    assert one_floor(extra='[negotiation]\nrest_at = "demand"\n').rest_at is RestAt.DEMAND
    assert one_floor(extra='[negotiation]\nrest_at = "nearest"\n').digest == one_floor().digest


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('rides = "never"', '"never"'),
        ('rest_at = "home"', '"home"'),
        ('place = "far"', '"far"'),
        ("sub_call_percent = 90", "from 20 to 80"),
        ("ride = 1", "ride"),
    ],
)
def test_a_mistake_is_told_with_its_line(line: str, told: str) -> None:
    with pytest.raises(ConfigError, match=r"test\.toml:\d+: negotiation\.") as caught:
        one_floor(extra=f"[negotiation]\n{line}\n")
    assert told in str(caught.value)


def test_cars_stand_where_they_are_soonest_unless_the_site_says_otherwise() -> None:
    assert one_floor().place is PlacePolicy.NEAREST
    for place in PlacePolicy:
        site = one_floor(extra=f'[negotiation]\nplace = "{place.value}"\n')
        assert site.place is place
        assert (site.digest == one_floor().digest) is (place is PlacePolicy.NEAREST), "who chooses otherwise is strange"


def test_cars_stay_where_they_are_unless_the_site_says_otherwise() -> None:
    assert not one_floor().quiet_moves
    site = one_floor(extra="[negotiation]\nquiet_moves = true\n")
    assert site.quiet_moves and site.digest != one_floor().digest


SECOND_BAY = '[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,8)"\n'


def test_a_car_comes_to_the_bay_that_suits_it_where_each_takes_cars_in_and_gives_them_out() -> None:
    assert one_floor().desk is DeskPolicy.ANY, "there is one alone"
    assert one_floor(extra=f'{SECOND_BAY}use = "exit"\n').desk is DeskPolicy.ANY
    said = [one_floor(extra=SECOND_BAY + word) for word in ("", '[negotiation]\ndesk = "nearest"\n')]
    assert [site.desk for site in said] == [DeskPolicy.NEAREST] * 2 and said[0].digest == said[1].digest
    site = one_floor(extra=f'{SECOND_BAY}[negotiation]\ndesk = "any"\n')
    assert site.desk is DeskPolicy.ANY and site.digest != said[0].digest, "who fetches otherwise is strange"

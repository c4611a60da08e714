"""What a site file means."""

import dataclasses
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.config.site import load_site, parse_site, site_digest
from onboard.contract.codes import KindCode, Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.site import car_park
from onboard.ways.site import Axis, Track, TrackKind, way_site
from onboard.work.timing import DeviceTiming
from tests.config.support import ROOT, TWO_FLOORS, changed

SHIPPED = sorted((ROOT / "bus_sim" / "sites").glob("*.toml"))

SMALLEST = """
[site]
name = "smallest"
[floors]
count = 1
positions = 3
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,2)"
[[robots]]
name = "MR1"
node = 2
home = "p(1,1)"
"""


def test_p30_p31_floors_lifts_compartments_and_spurs_become_tracks_and_stations() -> None:
    site = car_park(parse_site(TWO_FLOORS, "s.toml"))
    assert site.tracks == {
        1: Track(1, TrackKind.ALLEY, 8, 2_400),
        2: Track(2, TrackKind.ALLEY, 8, 2_400),
        128: Track(128, TrackKind.LIFT, 2, 2_500, (Segment(1, 1), Segment(2, 1))),
        129: Track(129, TrackKind.LIFT, 2, 2_500, (Segment(1, 8), Segment(2, 8))),
        192: Track(192, TrackKind.SPUR, 1, 2_400, (Segment(2, 5),)),
    }
    assert {node: (one.name, one.kind, one.home) for node, one in site.machines.items()} == {
        1: ("IOC1", KindCode.COMPARTMENT, Segment(1, 4)),
        2: ("LL", KindCode.LIFT, Segment(128, 1)),
        3: ("LR", KindCode.LIFT, Segment(129, 1)),
        11: ("MR1", KindCode.ROBOT, Segment(2, 3)),
    }
    assert site.compartments == {1: Station(1, 4, Side.NEAR)}
    assert len(site.places) == 2 * 2 * 8 - 2
    assert Station(1, 4, Side.NEAR) not in site.places
    assert Station(2, 5, Side.FAR) not in site.places
    assert [site.machine(one.name) for one in site.machines.values()] == list(site.machines.values()), "by their names"


def test_places_are_in_the_order_of_floor_side_and_index() -> None:
    places = car_park(parse_site(TWO_FLOORS, "s.toml")).places
    assert list(places) == sorted(places, key=lambda one: (one.track, one.side, one.index))


def test_gaps_by_place_by_position_and_on_all_floors() -> None:
    site = parse_site(changed("count = 2", 'count = 2\nwithout = ["p(1,7)N", "p(2,6)", "p(*,3)F"]'), "s.toml")
    gone = set(way_site(parse_site(TWO_FLOORS, "s.toml")).places) - set(way_site(site).places)
    assert sorted(map(str, gone)) == ["p(1,3)F", "p(1,7)N", "p(2,3)F", "p(2,6)F", "p(2,6)N"]


def test_a_floor_may_have_a_length_and_sides_of_its_own() -> None:
    text = changed("count = 2\npositions = 8\n", "count = 3\npositions = 8\n3.positions = 6\n3.sides = ['near']\n")
    text = changed('end = "right"', 'end = "right"\nfloors = [1, 2]', text)
    site = car_park(parse_site(text, "s.toml"))
    assert [site.tracks[1].length, site.tracks[3].length] == [8, 6]
    assert site.tracks[129].joins == (Segment(1, 8), Segment(2, 8))
    assert {str(place) for place in site.places if place.track == 3} == {f"p(3,{index})N" for index in range(1, 7)}


def test_defaults_of_speeds_lengths_and_times() -> None:
    site = car_park(parse_site(SMALLEST, "s.toml"))
    assert (site.bitrate, site.carrier, site.shuttle, site.lift) == (
        500_000,
        Axis(1_500, 500),
        Axis(750, 500),
        Axis(1_083, 500),
    )
    assert (site.carrier_length_mm, site.carrier_clearance_mm, site.shuttle_reach_mm) == (2_300, 50, 5_400)
    assert site.timing == DeviceTiming(
        call_window_us=1_000_000,
        bid_delay_us=300_000,
        bid_half_us=10_000_000,
        deadline_guard_us=20_000,
        max_attempts=5,
        award_repeat_us=100_000,
        token_repeat_us=200_000,
        heartbeat_us=2_000_000,
        bus_time_us=5_000_000,
        door_us=3_000_000,
        grip_us=2_000_000,
        drive_refresh_us=200_000,
    )


def test_the_bidding_delay_grows_with_robots_on_a_slow_bus() -> None:
    robots = "".join(f'[[robots]]\nname = "MR{n}"\nnode = {n + 10}\nhome = "p(1,{n + 10})"\n' for n in range(2, 21))
    text = changed("positions = 3", "positions = 40", SMALLEST) + robots + "[timing]\ncall_window_ms = 5_000\n"
    site = car_park(
        parse_site(changed('name = "smallest"', 'name = "smallest"\nbitrate = 20_000', text), "s.toml", crowded=True)
    )
    assert site.timing.bid_delay_us == 3 * 20 * 2 * 160 * 1_000_000 // 20_000


def test_a_robot_may_be_at_home_in_a_spur() -> None:
    site = parse_site(changed('home = "p(2,3)"', 'home = "p(192,1)"'), "s.toml")
    assert site.machines[11].home == Segment(192, 1)


def test_stewards_are_the_nearest_fixed_machines_unless_named() -> None:
    site = car_park(parse_site(TWO_FLOORS, "s.toml"))
    assert site.stewards == {1: 1, 2: 2, 128: 2, 129: 3, 192: 2}
    site = car_park(parse_site(TWO_FLOORS + '[stewards]\n2 = "IOC1"\n192 = "LR"\n', "s.toml"))
    assert site.stewards == {1: 1, 2: 1, 128: 2, 129: 3, 192: 3}


def test_ten_floors_of_forty_positions_fit_in_a_few_lines() -> None:
    site = car_park(parse_site(changed("count = 2\npositions = 8", "count = 10\npositions = 40"), "s.toml"))
    assert len(site.places) == 10 * 40 * 2 - 2
    assert site.tracks[128].length == 10


def test_two_texts_that_mean_the_same_have_the_same_digest() -> None:
    first = car_park(parse_site(TWO_FLOORS, "s.toml"))
    head, robots = TWO_FLOORS.split("[[robots]]")
    inline = 'robots = [{node = 0xB, home = "p( 2 , 3 )", name = "MR1"}]  # the same robot\n'
    second = car_park(parse_site(inline + head + "[carrier]\nspeed_mm_s = 1_500\n", "other.toml"))
    assert robots
    assert second == first


CHANGES = {
    "name": ('name = "two"', 'name = "three"'),
    "bitrate": ('name = "two"', 'name = "two"\nbitrate = 250_000'),
    "gap": ("count = 2", 'count = 2\nwithout = ["p(1,7)N"]'),
    "home": ('home = "p(2,3)"', 'home = "p(2,4)"'),
    "node": ("node = 11", "node = 12"),
    "speed": ("[[spurs]]", "[carrier]\nspeed_mm_s = 1_501\n[[spurs]]"),
    "timing": ("[[spurs]]", "[timing]\ngrip_ms = 2_001\n[[spurs]]"),
    "steward": ("[[spurs]]", '[stewards]\n2 = "LR"\n[[spurs]]'),
    "car": ("[[spurs]]", "[cars]\nmax_height_mm = 2_000\n[[spurs]]"),
    "side": ('at = "p(1,4)"', 'at = "p(1,4)"\nside = "far"'),
}


@pytest.mark.parametrize(("old", "new"), CHANGES.values(), ids=CHANGES.keys())
def test_another_meaning_has_another_digest(old: str, new: str) -> None:
    assert car_park(parse_site(changed(old, new), "s.toml")).digest != car_park(parse_site(TWO_FLOORS, "s.toml")).digest


@given(st.integers(10, 20_000))
def test_the_digest_is_of_16_bits_and_never_0(speed_mm_s: int) -> None:
    site = car_park(parse_site(SMALLEST, "s.toml"))
    assert 1 <= site_digest(dataclasses.replace(site, carrier=Axis(speed_mm_s, 500))) <= 0xFFFF


@given(st.integers(1, 3), st.integers(2, 126), st.text(" \t", max_size=2))
def test_p31_a_position_is_read_as_it_is_written(floor: int, index: int, blank: str) -> None:
    segment = Segment(floor, index)
    written = str(segment).replace(",", f"{blank},{blank}")
    text = f"""
    site = {{name = "s"}}
    floors = {{count = 3, positions = 127, sides = ["near"]}}
    lifts = [{{name = "L", node = 3, end = "left"}}]
    compartments = [{{name = "C", node = 1, at = "p({floor % 3 + 1},{index})"}}]
    robots = [{{name = "R", node = 2, home = "{written}"}}]
    """
    assert car_park(parse_site(text, "s.toml")).machines[2].home == segment


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_site_loads_and_carries_its_file_name(path: Path) -> None:
    assert load_site(path).name == path.stem


def test_level1_holds_the_cars_of_fourteen_stalls() -> None:
    site = load_site(ROOT / "bus_sim" / "sites" / "level1.toml")
    kinds = [machine.kind for machine in site.machines.values()]
    assert kinds == [KindCode.COMPARTMENT, KindCode.ROBOT]
    assert len(way_site(site).places) == 23
    assert site.stewards == {1: 1}

"""Whatever a site file says of its machines, within docs/site-file.md: all are served, as with the defaults."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site
from onboard.config.site import parse_site
from onboard.contract.codes import Operation
from onboard.contract.messages import CallForProposals, TokenRequest
from onboard.systems.car_park import kept_out
from onboard.systems.car_park.site import CarPark, car_park
from tests.sites import ONE_FLOOR, one_floor
from tests.system.scene import Scene, play, stays

#: Longer than a drive with orders may stand, and than a robot waited before a bay.
TURN_US, DOOR_US = 20_000_000, 12_000_000
THREE_CARS = stays((0, 200), (20, 220), (40, 240))


def assert_all_served(scene: Scene) -> None:
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served) == (3, 3)


def test_who_turns_for_long_is_not_stuck() -> None:
    """By the word of any drive that had not moved for 8 s it was, in each turn, and gave back all that it had won."""
    site = one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n[[spurs]]\nat = "p(1,9)"\n')
    assert_all_served(play(replace(site, carrier_turn_us=TURN_US), THREE_CARS, limit_s=1_500, extra_s=0))


def test_who_goes_slowly_from_mark_to_mark_is_not_stuck() -> None:
    """A drive says where it is at the middles and borders of segments: these were farther apart than 8 s."""
    text = ONE_FLOOR.format(positions=9).replace("count = 1", "count = 1\npitch_mm = 8_000")
    homes = ('[[spurs]]\nat = "p(1,7)"\n', '[[robots]]\nname = "MR1"\nnode = 11\nhome = "p(192,1)"\n')
    slow = "[carrier]\nspeed_mm_s = 300\nturn_ms = 30_000\n"
    scene = play(car_park(parse_site(text + "".join(homes) + slow, "slow.toml")), THREE_CARS, limit_s=6_000, extra_s=0)
    assert_all_served(scene)


def with_slow_doors() -> CarPark:
    site = car_park(find_site("level1"))
    return replace(site, timing=replace(site.timing, door_us=DOOR_US))


def test_before_slow_doors_a_robot_waits_so_much_longer() -> None:
    """It put its car back before they could be open, and that was fetched once more."""
    scene = play(with_slow_doors(), THREE_CARS, limit_s=1_500, extra_s=0)
    assert_all_served(scene)
    assert sum(one.operation is Operation.RETRIEVE for _, one in scene.all(CallForProposals)) == len(THREE_CARS.stays)


def test_who_brings_the_next_car_by_a_right_that_was_given_for_another_one_is_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It had put that one back before the right came: the bay waited for it, and knew nobody for the one it had."""
    monkeypatch.setattr(kept_out, "EMPTY_DOORS", 0)
    monkeypatch.setattr(kept_out, "REFUSED_PATIENCE_US", 45_000_000)
    assert_all_served(play(with_slow_doors(), THREE_CARS, limit_s=1_500, extra_s=0))


def test_a_carrier_as_long_as_a_slot_is_in_that_slot_alone() -> None:
    """By its own drive it was in the next one too: before a lift it waited for a platform that nobody had called."""
    site = one_floor(2)
    scene = play(replace(site, carrier_length_mm=site.tracks[1].pitch_mm), stays((5, 200)), limit_s=15, extra_s=0)
    scene.assert_sound()
    assert scene.all(TokenRequest) == [], "each holds the one slot of its home"

"""Whatever a site file says of its machines, within docs/site-file.md: all are served, as with the defaults."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site
from onboard.systems.car_park.site import CarPark, car_park
from tests.sites import one_floor
from tests.system.scene import play, stays

#: Longer than a drive with orders may stand, and than a robot waits before a bay.
TURN_US, DOOR_US = 20_000_000, 12_000_000


def turning_long() -> CarPark:
    """Robots that turn for 20 s: as any that did not move for 8 s they were stuck, by their own word, in each turn."""
    return replace(one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n[[spurs]]\nat = "p(1,9)"\n'), carrier_turn_us=TURN_US)


def opening_slowly() -> CarPark:
    """Doors that take 12 s: a robot put its car back, and the next came before it by the right that came late."""
    site = car_park(find_site("level1"))
    return replace(site, timing=replace(site.timing, door_us=DOOR_US))


@pytest.mark.parametrize("site", [turning_long(), opening_slowly()], ids=["turns", "doors"])
def test_who_has_slow_machines_serves_all_the_same(site: CarPark) -> None:
    scene = play(site, stays((0, 200), (20, 220), (40, 240)), limit_s=1_500, extra_s=0)
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served) == (3, 3)

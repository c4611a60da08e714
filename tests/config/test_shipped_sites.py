"""The sites that ship: as large as they say, and none of their robots shut in."""

import pytest

from bus_sim.sites import find_site, site_names
from onboard.contract.codes import KindCode
from onboard.core.site import Machine, Segment
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.occupancy import standing_segments
from onboard.ways.reach import stranded_by
from onboard.ways.refuges import open_refuges
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow
from onboard.ways.sipp import NoRoute, Visit, plan_route
from onboard.ways.site import TrackKind, WaySite

SECOND = 1_000_000
#: Floors, positions, places, then compartments, lifts, robots and spurs.
SIZES = {
    "level1": (1, 12, 23, 1, 0, 1, 0),
    "small": (3, 10, 59, 1, 2, 2, 0),
    "standard": (5, 20, 191, 3, 2, 4, 1),
    "large": (10, 40, 781, 4, 2, 12, 5),
}


def of_kind(site: WaySite, kind: KindCode) -> list[Machine]:
    return [machine for machine in site.machines.values() if machine.kind is kind]


def test_p30_every_shipped_site_has_the_size_that_it_is_known_for() -> None:
    assert [name for name in site_names() if find_site(name).system == CarPark.system] == sorted(SIZES)
    for name, size in SIZES.items():
        site = car_park(find_site(name))
        tracks = list(site.tracks.values())
        alleys = [track for track in tracks if track.kind is TrackKind.ALLEY]
        machines = [len(of_kind(site, kind)) for kind in (KindCode.COMPARTMENT, KindCode.LIFT, KindCode.ROBOT)]
        spurs = sum(1 for track in tracks if track.kind is TrackKind.SPUR)
        assert (len(alleys), alleys[0].length, len(site.places), *machines, spurs) == size, name


@pytest.mark.parametrize("name", ["small", "standard", "large"])
def test_the_loss_of_either_lift_strands_nothing(name: str) -> None:
    site = car_park(find_site(name))
    assert [stranded_by(site, lift.home.track) for lift in of_kind(site, KindCode.LIFT)] == [(), ()]


@pytest.mark.parametrize("name", ["small", "standard", "large"])
def test_with_all_robots_at_home_for_ever_any_one_finds_a_way_to_every_place_not_before_another(name: str) -> None:
    site = car_park(find_site(name))
    robots = of_kind(site, KindCode.ROBOT)
    fronts = [station.segment for station in site.compartments.values()]
    for number, place in enumerate(site.places):
        robot = robots[number % len(robots)]
        others = [one.home for one in robots if one is not robot]
        if place.segment not in others:
            found = route(site, robot, others, (fronts[number % len(fronts)], place.segment))
            assert found, (robot.name, str(place))


def route(site: WaySite, robot: Machine, others: list[Segment], goals: tuple[Segment, ...]) -> bool:
    """Whether a robot can carry a car between two segments and end in a refuge, the others standing for ever."""
    reservations = Reservations()
    for node_id, home in enumerate(others, start=100):
        reservations.reserve(node_id, [SlotWindow(one, 0, FOREVER) for one in standing_segments(site, home)])
    visits = tuple(Visit(goal, 20 * SECOND) for goal in goals)
    refuges = open_refuges(site, others)
    found = plan_route(site, reservations, robot.node_id, robot.home, 0, visits, refuges, 8_000)
    return not isinstance(found, NoRoute)

"""Where a machine may stand for ever."""

from dataclasses import replace

from onboard.contract.codes import KindCode, Side
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.site import CarPark
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.site import Axis, Track, TrackKind
from tests.sites import one_floor
from tests.ways.buildings import LEFT, RIGHT, building
from tests.ways.lines import SPUR


def test_on_one_floor_everywhere_but_before_the_compartment() -> None:
    assert refuges(one_floor()) == {Segment(1, index) for index in range(1, 13) if index != 4}


def park(compartment_floors: tuple[int, ...] = (1,)) -> CarPark:
    """Three floors of six places with lifts; a spur joins p(2,3)."""
    site = building(3, 6, Axis(1_500, 500), pitch_mm=2_400, floor_mm=2_500, carrier_length_mm=2_300)
    tracks = site.tracks | {SPUR: Track(SPUR, TrackKind.SPUR, 1, 2_400, (Segment(2, 3),))}
    machines = {
        floor: Machine(floor, f"IOC{floor}", KindCode.COMPARTMENT, Segment(floor, 4), Station(floor, 4, Side.NEAR))
        for floor in compartment_floors
    }
    return replace(site, tracks=tracks, machines=machines)


def alley(floor: int, *indices: int) -> set[Segment]:
    return {Segment(floor, index) for index in indices}


def test_neither_sills_nor_platforms_nor_the_mouth_of_a_spur_but_the_spur() -> None:
    assert refuges(park()) == alley(1, 2, 3, 5) | alley(2, 2, 4, 5) | alley(3, 2, 3, 4, 5) | {Segment(SPUR, 1)}


def test_open_are_alleys_above_the_street_and_spurs_in_which_nobody_stands() -> None:
    site, spur = park(), {Segment(SPUR, 1)}
    second, third = alley(2, 2, 4, 5), alley(3, 2, 3, 4, 5)
    assert open_refuges(site, ()) == second | third | spur
    assert open_refuges(site, [Segment(3, 5), Segment(1, 2)]) == second | spur
    assert open_refuges(site, [Segment(SPUR, 1), Segment(2, 5)]) == third
    assert open_refuges(site, [Segment(SPUR, 1), Segment(2, 5), Segment(3, 0)]) == frozenset()


def test_with_compartments_on_all_floors_the_lowest_alley_stays_free() -> None:
    assert {segment.track for segment in open_refuges(park((1, 2, 3)), ())} == {2, 3, SPUR}


def test_on_one_floor_every_refuge_is_open() -> None:
    assert open_refuges(one_floor(), [Segment(1, 7)]) == refuges(one_floor())


def test_on_one_floor_with_a_spur_for_each_the_alley_stays_free() -> None:
    site = one_floor(2, extra='[[spurs]]\nat = "p(1,2)"\n[[spurs]]\nat = "p(1,8)"\n')
    assert open_refuges(site, ()) == {Segment(SPUR, 1), Segment(SPUR + 1, 1)}
    assert open_refuges(site, [Segment(SPUR, 1)]) == {Segment(SPUR + 1, 1)}
    too_few = one_floor(2, extra='[[spurs]]\nat = "p(1,2)"\n')
    assert open_refuges(too_few, ()) == refuges(too_few)


def shafts(robots: int) -> CarPark:
    """Five floors; one lift serves floors 1 to 3, the other 3 to 5: from floor 3 on up there is no way but floor 3."""
    site = building(5, 6, Axis(1_500, 500), pitch_mm=2_400, floor_mm=2_500, carrier_length_mm=2_300)
    left, right = site.tracks[LEFT], site.tracks[RIGHT]
    tracks = site.tracks | {
        LEFT: replace(left, length=3, joins=left.joins[:3]),
        RIGHT: replace(right, length=3, joins=right.joins[2:]),
    }
    street = Machine(1, "IOC1", KindCode.COMPARTMENT, Segment(1, 4), Station(1, 4, Side.NEAR))
    machines = {n: Machine(n, f"MR{n}", KindCode.ROBOT, Segment(2, 3), None) for n in range(11, 11 + robots)}
    return replace(site, tracks=tracks, machines={1: street, **machines})


def test_nobody_stays_in_an_alley_through_which_the_others_go_to_the_floors_above() -> None:
    assert {segment.track for segment in open_refuges(shafts(2), ())} == {2, 4, 5}
    assert {segment.track for segment in open_refuges(shafts(2), [Segment(4, 3)])} == {2, 5}


def test_a_lone_robot_cuts_nobody_off() -> None:
    assert {segment.track for segment in open_refuges(shafts(1), ())} == {2, 3, 4, 5}

"""Whole sites that are not straight: machines turn, pass a lift in line, go one way round; no checker says a word."""

from collections.abc import Callable

import pytest

from onboard.contract.codes import Grade, LegAction, Operation, Side
from onboard.contract.messages import CallForProposals, DriveState, Itinerary, Progress
from onboard.core.site import Segment, Station
from onboard.systems.car_park.site import CarPark
from onboard.ways.site import BayUse
from tests.system.scene import Scene, play, stays
from tests.ways.networks import alley, at, branched, in_line, network, ring, running, spur

#: Places that there are: all others are left out, so that cars go where the feature is.
BUILDINGS: dict[str, tuple[Callable[[], CarPark], set[Segment]]] = {
    "ring": (ring, {at(3, 2), at(4, 2)}),
    "one-way ring": (lambda: ring(1), {at(3, 2), at(4, 2), at(1, 2)}),
    "lift in line": (in_line, {at(2, 3), at(3, 4)}),
    "branches and a lift at a stub": (branched, {at(2, 3), at(3, 2), at(4, 2)}),
}


def only(site: CarPark, segments: set[Segment]) -> CarPark:
    """The same site with no other places than those on the far side of these segments."""
    site.__dict__["places"] = tuple(
        place for place in site.places if place.segment in segments and place.side is Side.FAR
    )
    return site


def hops(scene: Scene) -> set[tuple[int, int]]:
    """Segments into which machines came through a mouth."""
    return {
        (leg.track, leg.to_index)
        for _, plan in scene.all(Itinerary, "fleet")
        if plan.grade is Grade.FIRM
        for leg in plan.legs
        if leg.action is LegAction.TRAVEL and leg.from_index == leg.to_index
    }


@pytest.mark.parametrize("name", BUILDINGS)
def test_cars_come_and_go_wherever_the_ways_lead(name: str) -> None:
    make, places = BUILDINGS[name]
    site = only(running(make()), places)
    scene = play(site, stays((0, 150), (40, 260)))
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 2
    if name == "lift in line":
        rides = [leg for _, plan in scene.all(Itinerary, "fleet") for leg in plan.legs if leg.action is LegAction.RIDE]
        assert {(leg.from_index, leg.to_index) for leg in rides} >= {(1, 2), (2, 1)}
    else:
        assert len(hops(scene)) >= 3


def test_on_a_one_way_ring_nobody_goes_against_it() -> None:
    site = only(running(ring(1)), {at(3, 2), at(1, 2)})
    scene = play(site, stays((0, 120), (30, 240)))
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 2
    ordered = [(m.track, m.index, m.speed_mm_s) for _, m in scene.all(Progress, "fleet") if m.sender >= 11]
    assert all(speed >= 0 for track, _, speed in ordered if track <= 4)


def test_every_turn_is_said_by_the_drive_on_the_tape_of_its_track() -> None:
    site = only(running(ring()), {at(3, 2), at(4, 2)})
    scene = play(site, stays((0, 150)))
    tracks = set()
    for _, state in scene.all(DriveState):
        told = site.on_tape(state.position_mm) if state.sender >= 11 else None
        if told is not None:
            assert state.across is site.across(told.track)
            tracks.add(told.track)
    assert {1, 2, 3} <= tracks or {1, 4} <= tracks


def test_cars_come_in_at_an_entry_and_go_out_at_an_exit() -> None:
    bays = Station(1, 2, Side.NEAR), Station(2, 4, Side.NEAR)
    shape = network(alley(1, 6), alley(2, 5, at(1, 6)), alley(3, 4, at(1, 4)), spur(192, 2, at(2, 2)), bays=bays)
    site = running(shape, uses={1: BayUse.ENTRY, 2: BayUse.EXIT})
    scene = play(site, stays((0, 120), (20, 200)))
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 2
    calls = {(m.operation, m.sender) for _, m in scene.all(CallForProposals, "fleet")}
    assert {one for one in calls if one[0] is not Operation.RIDE} == {(Operation.PARK, 1), (Operation.RETRIEVE, 2)}

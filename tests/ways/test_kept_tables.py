"""What a search keeps: as much as the site needs, and gone as soon as plans make it stale."""

import gc
import random
import weakref
from collections.abc import Iterator

import pytest

from bus_sim.sites import find_site
from onboard.systems.car_park.site import car_park
from onboard.ways.roads import roads_of
from tests.ways.fleets import SECOND, Fleet, park


@pytest.fixture(autouse=True)
def _nobody_looks_for_rings() -> Iterator[None]:
    gc.disable()
    yield
    gc.enable()


def asked(busy: int) -> tuple[Fleet, int]:
    """A fleet, and who of it has planned around so many others last."""
    fleet = Fleet(park(3, 10, 2), random.Random("kept"))
    myself, *others = fleet.ends
    fleet.busy(others[:busy])
    fleet.query(myself, 30 * SECOND)
    return fleet, myself


def kept_of(fleet: Fleet, owner: int) -> list["weakref.ref[object]"]:
    return [weakref.ref(one) for (node, _), one in fleet.reservations.kept.items() if node == owner]


def test_what_is_kept_goes_at_once_when_somebody_plans_anew() -> None:
    # A full look for rings among all that a machine has made took longer than the search itself.
    fleet, myself = asked(1)
    found = kept_of(fleet, myself)
    assert found
    fleet.busy([node for node in fleet.ends if node != myself])
    assert [ref() for ref in found if ref() is not None] == []


def test_a_search_on_a_copy_leaves_nothing_behind() -> None:
    # Bids are searched on copies of what others occupy.
    fleet, myself = asked(1)
    gc.collect()
    theirs = fleet.reservations
    fleet.reservations = theirs.copy()
    fleet.query(myself, 30 * SECOND)
    assert fleet.reservations.kept
    fleet.reservations = theirs
    assert gc.collect() == 0


def test_runs_of_a_track_are_kept_once_for_all_its_positions() -> None:
    site = car_park(find_site("large"))
    roads = roads_of(site)
    tracks = {place.segment.track for place in site.places}
    for track in tracks:
        indices = sorted(one.index for one in roads.positions(track))
        for here in indices:
            for there in indices:
                assert (roads.runs(track)[there - here] is None) == (here == there)
    # Lower and higher indices, and none: 840 where each position had 41 of its own, 17,220.
    assert sum(len(roads.runs(track)) for track in tracks) == 10 * (2 * 41 + 1)

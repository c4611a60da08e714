"""Cars over buildings of every form, published ones and designs with one feature each; more seeds: docs/layouts.md."""

import pytest

from bus_sim.sites import find_site, layout_names
from bus_sim.systems.car_park.demand import Demand
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.lifts import is_same_stop
from onboard.ways.site import BayUse, TrackKind
from tests.system.scene import play

#: What each design is there to show.
FEATURES = {
    "a turn": "corner",
    "a branch": "branch",
    "a cross": "branch",
    "a ring": "ring",
    "one way": "ring",
    "two alleys on a floor": "twin",
    "a lift beside an alley": "changi",
    "a lift in mid-alley": "inline",
    "a lift that skips a floor": "inline",
    "a lift with two doors": "twin",
    "a long spur": "branch",
    "an exit alone": "inline",
    "a compartment on an upper floor": "inline",
    "places for small cars": "sizes",
}


def has(site: CarPark, feature: str) -> bool:
    tracks = list(site.tracks.values())
    alleys = [track for track in tracks if track.kind is TrackKind.ALLEY]
    lifts = [track for track in tracks if track.kind is TrackKind.LIFT]
    named = [site.tracks[number] for number in site.alley_names]
    levels = [[site.level(sill.track) for sill in lift.joins] for lift in lifts]
    last = {mouth for mouth in site.links if mouth.index in (1, site.tracks[mouth.track].length)}
    match feature:
        case "a turn":
            return any(one.low in last for one in named)
        case "a branch":
            return any(one.low is not None and one.low not in last for one in named)
        case "a cross":
            return any(len([end for end in ends if end.track in site.alley_names]) > 1 for ends in site.links.values())
        case "a ring":
            return any(one.low is not None and one.high is not None for one in named)
        case "one way":
            return any(track.one_way for track in alleys)
        case "two alleys on a floor":
            return len({site.level(one.number) for one in named if not one.ends}) > 0
        case "a lift beside an alley":
            return any(site.tracks[sill.track].ends for lift in lifts for sill in lift.joins)
        case "a lift in mid-alley":
            return any(not site.tracks[sill.track].ends and sill.index > 1 for lift in lifts for sill in lift.joins)
        case "a lift that skips a floor":
            return any(sorted(set(one)) != list(range(min(one), max(one) + 1)) for one in levels)
        case "a lift with two doors":
            return any(is_same_stop(site, lift.number, 1, 2) for lift in lifts)
        case "a long spur":
            return any(track.kind is TrackKind.SPUR and track.length > 1 for track in tracks)
        case "an exit alone":
            return BayUse.EXIT in site.bay_uses.values()
        case "a compartment on an upper floor":
            return any(site.level(bay.track) > 1 for bay in site.compartments.values())
        case "places for small cars":
            return bool(site.place_class)
    raise AssertionError(feature)


@pytest.mark.parametrize(("feature", "name"), FEATURES.items())
def test_each_feature_of_the_model_is_in_a_layout(feature: str, name: str) -> None:
    assert has(car_park(find_site(name)), feature)
    assert not has(car_park(find_site("small")), feature), "and in no straight building"


@pytest.mark.parametrize("name", layout_names())
def test_cars_come_and_go_with_all_checkers_silent(name: str) -> None:
    scene = play(find_site(name), Demand.by_mean(60, 20, seed=1, count=3), limit_s=3_600)
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.served, street.inside) == (3, 0)


#: Published figures (docs/layouts.md): floors, places, compartments, lifts.
PUBLISHED = {"changi": (5, 195, 4, 4), "hoboken": (7, 304, 4, 2), "vtc": (12, 440, 2, 6), "crescent": (4, 21, 1, 1)}


@pytest.mark.parametrize(("name", "figures"), PUBLISHED.items())
def test_a_published_layout_has_the_figures_that_are_published(name: str, figures: tuple[int, int, int, int]) -> None:
    site = car_park(find_site(name))
    levels = {site.level(number) for number, track in site.tracks.items() if track.kind is TrackKind.ALLEY}
    assert (len(levels), len(site.places), len(site.compartments), len(site.lifts)) == figures

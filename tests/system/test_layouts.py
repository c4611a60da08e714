"""Cars over buildings of every form, published ones and designs with one feature each; more seeds: docs/layouts.md."""

from collections import Counter
from collections.abc import Callable

import pytest

from bus_sim.options import RunOptions
from bus_sim.session import play as run_to_its_end
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.stage import CarParkStage
from onboard.contract.codes import KindCode
from onboard.core.site import Segment
from onboard.systems.car_park.site import DeskPolicy, car_park
from onboard.ways.lifts import is_same_stop
from onboard.ways.site import BayUse, TrackKind
from tests.system.scene import play
from tests.thinned import is_long


class Building:
    """What one asks of a site to see which features it has."""

    def __init__(self, name: str) -> None:
        self.site = site = car_park(find_site(name))
        tracks = list(site.tracks.values())
        self.alleys = [track for track in tracks if track.kind is TrackKind.ALLEY]
        self.named = [site.tracks[number] for number in site.alley_names]
        self.spurs = [track for track in tracks if track.kind is TrackKind.SPUR]
        self.sills = {lift: site.tracks[lift].joins for lift in site.lifts}
        self.levels = [[site.level(sill.track) for sill in sills] for sills in self.sills.values()]
        self.bays = list(site.compartments.values())
        #: Mouths at the last slot of their alleys: who goes off there turns.
        self.corners = {mouth for mouth in site.links if mouth.index in (1, site.tracks[mouth.track].length)}
        self.two_doors = [lift for lift in site.lifts if is_same_stop(site, lift, 1, 2)]

    def is_in_line(self, lift: int) -> bool:
        """Whether the first stop's doors are at a high and at a low end."""
        return len({self.site.beyond(sill).index == 0 for sill in self.sills[lift][:2]}) > 1


#: Of the layouts those that are played here; docs/layouts.md has the command for all.
PLAYED = ("ring", "twin", "inline", "changi")
#: Which design is there to show what, and how one sees that it does.
FEATURES: dict[str, tuple[str, Callable[[Building], bool]]] = {
    "a turn": ("corner", lambda one: any(alley.low in one.corners for alley in one.named)),
    "a branch": ("branch", lambda one: any(alley.low not in one.corners for alley in one.named)),
    "a cross": ("branch", lambda one: any(len(ends) > 1 for ends in one.site.links.values())),
    "a ring": ("ring", lambda one: any(len(alley.ends) > 1 for alley in one.named)),
    "one way": ("ring", lambda one: any(alley.one_way for alley in one.alleys)),
    "two alleys on a floor": ("twin", lambda one: any(not alley.ends for alley in one.named)),
    "a lift beside an alley": ("changi", lambda one: len(one.alleys) > len(one.named) + max(map(max, one.levels))),
    "a lift in mid-alley": ("inline", lambda one: any(one.is_in_line(lift) for lift in one.two_doors)),
    "a lift with two doors": ("twin", lambda one: bool(one.two_doors)),
    "a lift that skips a floor": ("inline", lambda one: any(len(set(at)) <= max(at) - min(at) for at in one.levels)),
    "a long spur": ("branch", lambda one: any(spur.length > 1 for spur in one.spurs)),
    "an exit alone": ("inline", lambda one: BayUse.EXIT in one.site.bay_uses.values()),
    "an upper compartment": ("inline", lambda one: any(one.site.level(bay.track) > 1 for bay in one.bays)),
    "places for small cars": ("sizes", lambda one: bool(one.site.place_class)),
}


@pytest.mark.parametrize("feature", FEATURES)
def test_each_feature_of_the_model_is_in_a_layout_and_in_no_straight_building(feature: str) -> None:
    name, is_there = FEATURES[feature]
    assert is_there(Building(name))
    assert not is_there(Building("small"))


@pytest.mark.parametrize("name", PLAYED)
def test_cars_come_and_go_with_all_checkers_silent(name: str) -> None:
    cars = 3 if is_long() else 2
    scene = play(find_site(name), Demand.by_mean(60, 20, seed=1, count=cars), limit_s=3_600)
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.served, street.inside) == (cars, 0)


def test_who_is_left_alone_rests_where_it_can_tell_the_way_to_the_car_and_home() -> None:
    """From its spur, the only one that nobody stands in, a fetch has more legs than are told: no car came out."""
    day = ParkingDay(random_s=(60, 15), cars=1)
    stage = run_to_its_end(find_site("ring"), RunOptions(seed=1, demand=day, without=frozenset({"MR1"})))
    assert (stage.violations(), stage.tally().served, stage.tally().waiting) == ([], 1, 0)


def test_robots_of_the_tower_start_beside_its_compartments_and_cars_come_to_the_one_beside_them() -> None:
    tower = Building("tower")
    robots = [machine for machine in tower.site.machines.values() if machine.kind is KindCode.ROBOT]
    assert (len(tower.site.places), len(tower.bays), len(tower.sills), len(robots)) == (1_192, 4, 2, 4)
    assert {alley.length for alley in tower.alleys if alley.number <= 20} == {30}
    mouths = {tower.site.tracks[robot.home.track].low for robot in robots}
    assert mouths == {Segment(bay.track, bay.index - 2) for bay in tower.bays}
    # A car that comes to another compartment than the one beside it has to pass other robots in the street's one alley.
    assert tower.site.desk is DeskPolicy.NEAREST


#: Published figures (docs/layouts.md): floors, places, compartments, lifts.
PUBLISHED = {
    "changi": (5, 195, 4, 4),
    "hoboken": (7, 304, 4, 2),
    "vtc": (12, 440, 2, 6),
    "crescent": (4, 21, 1, 1),
    "harbour": (3, 972, 20, 10),
}


@pytest.mark.parametrize(("name", "figures"), PUBLISHED.items())
def test_a_published_layout_has_the_figures_that_are_published(name: str, figures: tuple[int, int, int, int]) -> None:
    site = car_park(find_site(name))
    levels = {site.level(number) for number, track in site.tracks.items() if track.kind is TrackKind.ALLEY}
    assert (len(levels), len(site.places), len(site.compartments), len(site.lifts)) == figures


def test_the_harbour_wakes_with_cars_inside_and_serves_who_comes_and_who_goes() -> None:
    """The largest site: 50 machines. Who is fetched never drove in, and its car comes to its own desk."""
    day = ParkingDay(random_s=(10, 1), cars=1, inside=20)
    stage = run_to_its_end(find_site("harbour"), RunOptions(seed=1, demand=day))
    assert isinstance(stage, CarParkStage)
    assert (stage.violations(), stage.halted, stage.tally().served) == ([], [], 1)
    gone = next(one for one in stage.customers if one.visit.gone_us is not None)
    assert gone.visit.arrived_us is None and gone.ticket is not None and gone.compartment is not None
    assert gone.ticket.car.origin == gone.compartment.node_id
    assert gone.visit.ready_us is not None
    assert (gone.visit.asked_us or 0) < gone.visit.ready_us < (gone.visit.gone_us or 0)


def test_on_the_harbour_no_machine_keeps_more_than_a_hundred_places() -> None:
    site = car_park(find_site("harbour"))
    kept = Counter(site.stewards[place.track] for place in site.places)
    assert sum(kept.values()) == 972 and max(kept.values()) <= 98
    assert all(site.stewards[bay.track] in site.compartments for bay in site.compartments.values())
